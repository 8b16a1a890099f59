//! Mutations of inputs: bits and bytes, lengths, pieces of other inputs, and words that are known to hurt.
// All mutations have one type; most of them change the length.
#![allow(clippy::ptr_arg)]

use btr_core::random::Rng;
use rand::RngExt;
use std::ops::Range;
use std::sync::LazyLock;

/// The longest input.
const LONGEST: usize = 1 << 16;
/// The most mutations of an input.
const MOST: u32 = 6;

/// Numbers, names and brackets that readers may stumble over.
const TOKENS: &str = "0 -0 1 -1 0.0 1e-12 1e9 1e300 1e308 -1e308 1e999 5e-324 nan inf -inf NaN 1000000 4294967295 \
    9223372036854775807 18446744073709551616 -9223372036854775808 0x10 1_000 true false null \"\" '' ../ ../../x \
    /dev/zero / . * @ # #3 , ; \t \r\n \n \n\n ]]> <![CDATA[ <!-- --> &amp; &#0; <a> </a> <link [ ] [[ ]] { } ( ) \
    (((((((((((((((( [[[[[[[[[[[[[[[[ {joint} {episode_index:099999d} q dq cmd t time atan2( ^ ** /0 \u{0} \u{feff} \
    \u{1b}[31m \u{e4} \u{1f916}";
static WORDS: LazyLock<Vec<&str>> = LazyLock::new(|| TOKENS.split(' ').collect());

/// An input made of the corpus by chance.
pub fn mutated(rng: &mut Rng, corpus: &[Vec<u8>]) -> Vec<u8> {
    let mut data = picked(rng, corpus).clone();
    // Mostly one or two: of text that is changed in many places, nothing is read.
    for _ in 0..MOST {
        let mutation = MUTATIONS[rng.random_range(0..MUTATIONS.len())];
        mutation(rng, &mut data, corpus);
        data.truncate(LONGEST);
        if rng.random_bool(0.6) {
            break;
        }
    }
    data
}

type Mutation = fn(&mut Rng, &mut Vec<u8>, &[Vec<u8>]);

const MUTATIONS: &[Mutation] = &[
    flip_bit,
    set_byte,
    set_number,
    set_length,
    delete,
    duplicate,
    splice,
    insert_token,
    replace_word,
    replace_word,
    swap_words,
    swap_lines,
    cut,
];

/// One of some; the first of an empty slice is empty.
fn picked<'a>(rng: &mut Rng, corpus: &'a [Vec<u8>]) -> &'a Vec<u8> {
    static EMPTY: Vec<u8> = Vec::new();
    if corpus.is_empty() { &EMPTY } else { &corpus[rng.random_range(0..corpus.len())] }
}

fn token(rng: &mut Rng) -> &'static [u8] {
    WORDS[rng.random_range(0..WORDS.len())].as_bytes()
}

/// A place in `length` bytes, or at their end.
fn place(rng: &mut Rng, length: usize) -> usize {
    rng.random_range(0..=length)
}

/// A piece of `length` bytes, mostly a short one.
fn piece(rng: &mut Rng, length: usize) -> Range<usize> {
    let from = place(rng, length);
    let most = if rng.random_bool(0.8) { 16 } else { length };
    from..(from + place(rng, most)).min(length)
}

fn flip_bit(rng: &mut Rng, data: &mut Vec<u8>, _: &[Vec<u8>]) {
    let at = place(rng, data.len());
    if let Some(byte) = data.get_mut(at) {
        *byte ^= 1 << rng.random_range(0..8_u32);
    }
}

fn set_byte(rng: &mut Rng, data: &mut Vec<u8>, _: &[Vec<u8>]) {
    let known = [0, 1, 0x7f, 0x80, 0xff, b'0', b'9', b'-', b'.', b'"', b'\n', rng.random()];
    let at = place(rng, data.len());
    if let Some(byte) = data.get_mut(at) {
        *byte = known[rng.random_range(0..known.len())];
    }
}

/// Overwrites 8 bytes with a floating-point number, of either byte order.
fn set_number(rng: &mut Rng, data: &mut Vec<u8>, _: &[Vec<u8>]) {
    let known = [0.0, -0.0, 1.0, -1.0, 1e-300, 1e300, f64::MAX, f64::MIN, f64::NAN, f64::INFINITY, f64::NEG_INFINITY];
    let number = known[rng.random_range(0..known.len())];
    let bytes = if rng.random() { number.to_le_bytes() } else { number.to_be_bytes() };
    overwrite(rng, data, &bytes);
}

/// Overwrites 1, 2, 4 or 8 bytes with an integer, as lengths and counts are.
fn set_length(rng: &mut Rng, data: &mut Vec<u8>, _: &[Vec<u8>]) {
    let near = (data.len() as u64).wrapping_add(rng.random_range(0..9_u64)).wrapping_sub(4);
    let known =
        [0, 1, near, 0x7fff_ffff, 0xffff_ffff, 1 << 28, 1 << 40, u64::MAX, u64::MAX / 2, rng.random_range(0..300)];
    let number = known[rng.random_range(0..known.len())];
    let width = 1 << rng.random_range(0..4_u32);
    if rng.random_bool(0.3) {
        return overwrite(rng, data, &varint(number));
    }
    overwrite(rng, data, &number.to_le_bytes()[..width]);
}

/// An integer as messages between processes have it.
fn varint(mut number: u64) -> Vec<u8> {
    let mut bytes = Vec::new();
    while number > 127 {
        bytes.push(number as u8 | 128);
        number >>= 7;
    }
    bytes.push(number as u8);
    bytes
}

fn overwrite(rng: &mut Rng, data: &mut [u8], bytes: &[u8]) {
    let at = place(rng, data.len());
    data[at..].iter_mut().zip(bytes).for_each(|(old, new)| *old = *new);
}

fn delete(rng: &mut Rng, data: &mut Vec<u8>, _: &[Vec<u8>]) {
    let piece = piece(rng, data.len());
    data.drain(piece);
}

fn cut(rng: &mut Rng, data: &mut Vec<u8>, _: &[Vec<u8>]) {
    if rng.random_bool(0.3) {
        data.truncate(place(rng, data.len()));
    }
}

/// Repeats a piece, up to a hundred times.
fn duplicate(rng: &mut Rng, data: &mut Vec<u8>, _: &[Vec<u8>]) {
    let piece = piece(rng, data.len());
    let times = if rng.random_bool(0.1) { 100 } else { 1 };
    let repeated = data[piece.clone()].repeat(times);
    data.splice(piece.end..piece.end, repeated);
}

/// Puts a piece of another input in the place of one of this.
fn splice(rng: &mut Rng, data: &mut Vec<u8>, corpus: &[Vec<u8>]) {
    let other = picked(rng, corpus);
    let (from, to) = (piece(rng, other.len()), piece(rng, data.len()));
    data.splice(to, other[from].iter().copied());
}

fn insert_token(rng: &mut Rng, data: &mut Vec<u8>, _: &[Vec<u8>]) {
    let at = place(rng, data.len());
    data.splice(at..at, token(rng).iter().copied());
}

/// Replaces a word (a number, a name) by a token.
fn replace_word(rng: &mut Rng, data: &mut Vec<u8>, _: &[Vec<u8>]) {
    let words = words(data);
    if !words.is_empty() {
        let word = words[rng.random_range(0..words.len())].clone();
        data.splice(word, token(rng).iter().copied());
    }
}

fn swap_words(rng: &mut Rng, data: &mut Vec<u8>, _: &[Vec<u8>]) {
    let words = words(data);
    swap(rng, data, &words);
}

fn swap_lines(rng: &mut Rng, data: &mut Vec<u8>, _: &[Vec<u8>]) {
    let lines = ranges(data, |byte| *byte != b'\n');
    swap(rng, data, &lines);
}

fn words(data: &[u8]) -> Vec<Range<usize>> {
    ranges(data, |byte| byte.is_ascii_alphanumeric() || b"_.-+@".contains(byte))
}

/// Where bytes of a kind follow each other.
fn ranges(data: &[u8], kind: impl Fn(&u8) -> bool) -> Vec<Range<usize>> {
    let mut ranges: Vec<Range<usize>> = Vec::new();
    for at in (0..data.len()).filter(|at| kind(&data[*at])) {
        match ranges.last_mut() {
            Some(last) if last.end == at => last.end = at + 1,
            _ => ranges.push(at..at + 1),
        }
    }
    ranges
}

fn swap(rng: &mut Rng, data: &mut Vec<u8>, ranges: &[Range<usize>]) {
    if ranges.len() < 2 {
        return;
    }
    let k = rng.random_range(1..ranges.len());
    let (first, second) = (ranges[rng.random_range(0..k)].clone(), ranges[k].clone());
    let (a, b) = (data[first.clone()].to_vec(), data[second.clone()].to_vec());
    data.splice(second, a);
    data.splice(first, b);
}

#[cfg(test)]
mod tests {
    use super::*;
    use btr_core::random::stream;

    #[test]
    fn the_same_seed_gives_the_same_input_and_another_one_another() {
        let corpus = [b"t,q\n0,1\n1,2\n".to_vec(), b"mass = 3.0".to_vec()];
        let of = |k: u64| mutated(&mut stream(1, &[k]), &corpus);
        let all: std::collections::BTreeSet<Vec<u8>> = (0..1000).map(of).collect();
        assert_eq!(of(7), of(7));
        assert!(all.len() > 300, "{} different inputs", all.len());
        assert!(mutated(&mut stream(1, &[0]), &[]).len() < LONGEST);
    }

    #[test]
    fn every_mutation_changes_something_and_swaps_keep_what_there_is() {
        let corpus = [b"first = 1\nsecond = [2.5, -3]\nthird = \"x\"\n".to_vec(), b"fourth".to_vec()];
        for (k, mutation) in MUTATIONS.iter().enumerate() {
            let changed = (0..20).filter(|&seed| {
                let mut data = corpus[0].clone();
                mutation(&mut stream(seed, &[k as u64]), &mut data, &corpus);
                data != corpus[0]
            });
            assert!(changed.count() > 2, "mutation {k}");
        }
        let mut data = corpus[0].clone();
        swap_words(&mut stream(1, &[]), &mut data, &[]);
        let sorted = |data: &[u8]| {
            let mut bytes = data.to_vec();
            bytes.sort_unstable();
            bytes
        };
        assert_eq!(sorted(&data), sorted(&corpus[0]));
    }
}
