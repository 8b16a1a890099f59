//! Scalars of several candidates: one in each lane of a SIMD register.
//!
//! Every operation rounds in each lane as it does for a single candidate, so that results do not depend on the number
//! of lanes. Everything here must be inlined: code that is compiled outside of [`Simd::vectorize`] cannot use the wide
//! registers.

use pulp::Simd;
use pulp::bytemuck::cast_slice;
use std::ops::{Add, AddAssign, Div, Mul, Neg, Sub, SubAssign};

/// One number per candidate.
#[derive(Clone, Copy)]
pub(in crate::engine::articulated) struct Lanes<S: Simd>(S, S::f64s);

/// One boolean per candidate.
#[derive(Clone, Copy)]
pub(in crate::engine::articulated) struct Mask<S: Simd>(S, S::m64s);

/// Adding and subtracting this rounds to integers, ties to even.
const ROUND: f64 = 6_755_399_441_055_744.0;
/// π/2 in two parts: the first has so few digits that its multiples are exact.
const QUARTER: (f64, f64) = (1.570_796_326_734_125_6, 6.077_100_506_506_192e-11);
/// Coefficients of the sine and the cosine between -45° and 45°: those of fdlibm (Sun Microsystems, 1993).
const SINE: [f64; 6] = [
    -1.666_666_666_666_663_2e-1,
    8.333_333_333_322_49e-3,
    -1.984_126_982_985_795e-4,
    2.755_731_370_707_006_8e-6,
    -2.505_076_025_340_686_3e-8,
    1.589_690_995_211_55e-10,
];
const COSINE: [f64; 6] = [
    4.166_666_666_666_66e-2,
    -1.388_888_888_887_411e-3,
    2.480_158_728_947_673e-5,
    -2.755_731_435_139_066_3e-7,
    2.087_572_321_298_175e-9,
    -1.135_964_755_778_819_5e-11,
];

impl<S: Simd> Lanes<S> {
    /// The same number in every lane.
    #[inline(always)]
    pub(in crate::engine::articulated) fn splat(simd: S, x: f64) -> Self {
        Lanes(simd, simd.splat_f64s(x))
    }

    #[inline(always)]
    pub(in crate::engine::articulated) fn zero(simd: S) -> Self {
        Lanes::splat(simd, 0.0)
    }

    /// A number for each lane.
    pub(in crate::engine::articulated) fn of(simd: S, number: impl Fn(usize) -> f64) -> Self {
        let mut lanes = Lanes::zero(simd);
        (0..S::F64_LANES).for_each(|lane| lanes.set(lane, number(lane)));
        lanes
    }

    #[inline(always)]
    pub(in crate::engine::articulated) fn lane(&self, lane: usize) -> f64 {
        cast_slice::<S::f64s, f64>(std::slice::from_ref(&self.1))[lane]
    }

    #[inline(always)]
    pub(in crate::engine::articulated) fn set(&mut self, lane: usize, x: f64) {
        pulp::bytemuck::cast_slice_mut::<S::f64s, f64>(std::slice::from_mut(&mut self.1))[lane] = x;
    }

    /// The same number in every lane, of this value's type.
    #[inline(always)]
    pub(in crate::engine::articulated) fn like(self, x: f64) -> Self {
        Lanes::splat(self.0, x)
    }

    /// `self + a·b`, rounded once.
    #[inline(always)]
    pub(in crate::engine::articulated) fn add_product(self, a: Self, b: Self) -> Self {
        Lanes(self.0, self.0.mul_add_f64s(a.1, b.1, self.1))
    }

    /// `self − a·b`, rounded once.
    #[inline(always)]
    pub(in crate::engine::articulated) fn sub_product(self, a: Self, b: Self) -> Self {
        Lanes(self.0, self.0.negate_mul_add_f64s(a.1, b.1, self.1))
    }

    #[inline(always)]
    pub(in crate::engine::articulated) fn sqrt(self) -> Self {
        Lanes(self.0, self.0.sqrt_f64s(self.1))
    }

    #[inline(always)]
    pub(in crate::engine::articulated) fn recip(self) -> Self {
        self.like(1.0) / self
    }

    #[inline(always)]
    pub(in crate::engine::articulated) fn abs(self) -> Self {
        Lanes(self.0, self.0.abs_f64s(self.1))
    }

    #[inline(always)]
    pub(in crate::engine::articulated) fn less(self, other: Self) -> Mask<S> {
        Mask(self.0, self.0.less_than_f64s(self.1, other.1))
    }

    #[inline(always)]
    pub(in crate::engine::articulated) fn less_or_equal(self, other: Self) -> Mask<S> {
        Mask(self.0, self.0.less_than_or_equal_f64s(self.1, other.1))
    }

    /// The larger one; `other` where either is NaN.
    #[inline(always)]
    pub(in crate::engine::articulated) fn max(self, other: Self) -> Self {
        other.less(self).select(self, other)
    }

    /// The smaller one; `other` where either is NaN.
    #[inline(always)]
    pub(in crate::engine::articulated) fn min(self, other: Self) -> Self {
        self.less(other).select(self, other)
    }

    #[inline(always)]
    pub(in crate::engine::articulated) fn clamp(self, lower: Self, upper: Self) -> Self {
        self.max(lower).min(upper)
    }

    /// Sine and cosine; accurate to the last digits up to 100,000 turns.
    #[inline(always)]
    pub(in crate::engine::articulated) fn sin_cos(self) -> (Self, Self) {
        let round = self.like(ROUND);
        let quarters = (self * self.like(std::f64::consts::FRAC_2_PI) + round) - round;
        let x = (self - quarters * self.like(QUARTER.0)) - quarters * self.like(QUARTER.1);
        let square = x * x;
        let sine = x + x * square * polynomial(square, &SINE);
        let cosine = (self.like(1.0) - square * self.like(0.5)) + square * square * polynomial(square, &COSINE);
        // The quadrant: 0, 1/4, 1/2 or -1/2, -1/4.
        let turns = quarters * self.like(0.25);
        let quarter = turns - ((turns + round) - round);
        let (early, late) = (self.like(0.125), self.like(0.375));
        let odd = early.less(quarter.abs()).and(quarter.abs().less(late));
        let half = late.less(quarter.abs());
        let below = half.or(quarter.less(-early));
        let left = half.or(early.less(quarter));
        let (s, c) = (odd.select(cosine, sine), odd.select(sine, cosine));
        (below.select(-s, s), left.select(-c, c))
    }
}

#[inline(always)]
fn polynomial<S: Simd>(x: Lanes<S>, coefficients: &[f64; 6]) -> Lanes<S> {
    let mut sum = x.like(coefficients[5]);
    for k in (0..5).rev() {
        sum = x.like(coefficients[k]).add_product(sum, x);
    }
    sum
}

impl<S: Simd> Mask<S> {
    #[inline(always)]
    pub(in crate::engine::articulated) fn select(self, yes: Lanes<S>, no: Lanes<S>) -> Lanes<S> {
        Lanes(self.0, self.0.select_f64s(self.1, yes.1, no.1))
    }

    #[inline(always)]
    pub(in crate::engine::articulated) fn and(self, other: Self) -> Self {
        Mask(self.0, self.0.and_m64s(self.1, other.1))
    }

    #[inline(always)]
    pub(in crate::engine::articulated) fn or(self, other: Self) -> Self {
        Mask(self.0, self.0.or_m64s(self.1, other.1))
    }

    #[inline(always)]
    pub(in crate::engine::articulated) fn not(self) -> Self {
        Mask(self.0, self.0.not_m64s(self.1))
    }

    /// Whether it is true in a lane.
    pub(in crate::engine::articulated) fn lane(self, lane: usize) -> bool {
        self.select(Lanes::splat(self.0, 1.0), Lanes::zero(self.0)).lane(lane) > 0.5
    }

    /// Whether it is true in any lane.
    #[inline(always)]
    pub(in crate::engine::articulated) fn any(self) -> bool {
        self.0.first_true_m64s(self.1) < S::F64_LANES
    }
}

macro_rules! operator {
    ($trait:ident, $method:ident, $simd:ident) => {
        impl<S: Simd> $trait for Lanes<S> {
            type Output = Self;
            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                Lanes(self.0, self.0.$simd(self.1, other.1))
            }
        }
    };
}
operator!(Add, add, add_f64s);
operator!(Sub, sub, sub_f64s);
operator!(Mul, mul, mul_f64s);
operator!(Div, div, div_f64s);

impl<S: Simd> Neg for Lanes<S> {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        Lanes(self.0, self.0.neg_f64s(self.1))
    }
}

impl<S: Simd> Mul<f64> for Lanes<S> {
    type Output = Self;
    #[inline(always)]
    fn mul(self, factor: f64) -> Self {
        self * self.like(factor)
    }
}

impl<S: Simd> AddAssign for Lanes<S> {
    #[inline(always)]
    fn add_assign(&mut self, other: Self) {
        *self = *self + other;
    }
}

impl<S: Simd> SubAssign for Lanes<S> {
    #[inline(always)]
    fn sub_assign(&mut self, other: Self) {
        *self = *self - other;
    }
}
