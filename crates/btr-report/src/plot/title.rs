//! The title of a panel, which may hold the long name of a log: on one line, or smaller on two.

/// Widths of a letter in a title on one line and on two, in px. The viewer chooses the font, so these are generous.
const LETTERS: [f64; 2] = [8.4, 7.6];
/// Where the only line stands, and where both do, in px from the top.
const BASELINES: [&[f64]; 2] = [&[20.0], &[12.0, 26.0]];

/// A title, broken to fit a width.
pub(super) struct Title {
    lines: Vec<String>,
    /// What is left on the last line, in px.
    pub(super) rest: f64,
    /// Where its last line stands.
    pub(super) baseline: f64,
}

impl Title {
    /// Breaks at a space where both parts fit, or else where the line ends; what two lines do not hold is cut in the
    /// middle, since names of logs differ at their ends.
    pub(super) fn new(text: &str, width: f64) -> Self {
        let most = LETTERS.map(|letter| (width / letter) as usize);
        let letters: Vec<char> = text.chars().collect();
        let lines = if letters.len() <= most[0] { vec![letters] } else { broken(&letters, most[1]) };
        let k = lines.len() - 1;
        let rest = width - LETTERS[k] * lines[k].len() as f64;
        let baseline = BASELINES[k].last().copied().unwrap_or_default();
        Title { lines: lines.into_iter().map(String::from_iter).collect(), rest, baseline }
    }

    /// Its class: two lines have smaller letters.
    pub(super) fn class(&self) -> &'static str {
        if self.lines.len() > 1 { "title long" } else { "title" }
    }

    /// Its lines, and where each stands.
    pub(super) fn lines(&self) -> impl Iterator<Item = (&str, f64)> {
        self.lines.iter().map(String::as_str).zip(BASELINES[self.lines.len() - 1].iter().copied())
    }
}

/// Two lines of at most so many letters.
fn broken(letters: &[char], most: usize) -> Vec<Vec<char>> {
    let fits = |&space: &usize| letters[space] == ' ' && space <= most && letters.len() - space - 1 <= most;
    if let Some(space) = (0..letters.len()).rev().find(fits) {
        return vec![letters[..space].to_vec(), letters[space + 1..].to_vec()];
    }
    let (first, rest) = letters.split_at(most.min(letters.len()));
    if rest.len() <= most {
        return vec![first.to_vec(), rest.to_vec()];
    }
    let end = rest[rest.len() + 1 - most..].iter().copied();
    vec![first.to_vec(), std::iter::once('…').chain(end).collect()]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_long_title_is_on_two_lines_with_the_end_of_the_name() {
        let lines = |title: &str| {
            let title = Title::new(title, 380.0);
            assert!(title.lines().all(|(line, _)| line.chars().count() <= 50) && title.rest >= 0.0);
            title.lines().map(|(line, y)| (line.to_owned(), y)).collect::<Vec<_>>()
        };
        assert_eq!(lines("yaw in monday.csv"), [("yaw in monday.csv".to_owned(), 20.0)]);
        let log = "2026-11-27_arm_left_sine_sweep_200_hz_run_07.csv";
        let two = lines(&format!("shoulder in {log}"));
        assert_eq!(two, [("shoulder in".to_owned(), 12.0), (log.to_owned(), 26.0)]);
        let whole = format!("Residual in {}{log}", "x".repeat(30));
        let longer = lines(&whole);
        assert_eq!(format!("{}{}", longer[0].0, longer[1].0), whole, "broken within the name");
        let cut = lines(&format!("Residual in {}{log}", "x".repeat(99)));
        assert!(cut[0].0.starts_with("Residual in x") && cut[1].0.starts_with('…') && cut[1].0.ends_with("07.csv"));
    }
}
