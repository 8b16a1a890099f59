//! 3-D vectors and matrices of several candidates.

use super::lanes::{Lanes, Mask};
use nalgebra::{Matrix3, Vector3};
use pulp::Simd;
use std::ops::{Add, Sub};

/// One vector per candidate.
#[derive(Clone, Copy)]
pub(in crate::engine::articulated) struct V3<S: Simd>(pub(in crate::engine::articulated) [Lanes<S>; 3]);

/// One matrix per candidate, row-major.
#[derive(Clone, Copy)]
pub(in crate::engine::articulated) struct M3<S: Simd>(pub(in crate::engine::articulated) [[Lanes<S>; 3]; 3]);

impl<S: Simd> V3<S> {
    #[inline(always)]
    pub(in crate::engine::articulated) fn zero(simd: S) -> Self {
        V3([Lanes::zero(simd); 3])
    }

    pub(in crate::engine::articulated) fn of(simd: S, vector: impl Fn(usize) -> Vector3<f64>) -> Self {
        V3([0, 1, 2].map(|k| Lanes::of(simd, |lane| vector(lane)[k])))
    }

    /// The k-th axis.
    #[inline(always)]
    pub(in crate::engine::articulated) fn axis(simd: S, k: usize) -> Self {
        let mut axis = V3::zero(simd);
        axis.0[k] = Lanes::splat(simd, 1.0);
        axis
    }

    pub(in crate::engine::articulated) fn lane(&self, lane: usize) -> Vector3<f64> {
        let [x, y, z] = &self.0;
        Vector3::new(x.lane(lane), y.lane(lane), z.lane(lane))
    }

    pub(in crate::engine::articulated) fn set(&mut self, lane: usize, vector: &Vector3<f64>) {
        self.0.iter_mut().zip(vector.iter()).for_each(|(lanes, x)| lanes.set(lane, *x));
    }

    /// `yes` where the mask is true, `no` where it is false.
    #[inline(always)]
    pub(in crate::engine::articulated) fn select(mask: Mask<S>, yes: &Self, no: &Self) -> Self {
        let mut chosen = *no;
        for k in 0..3 {
            chosen.0[k] = mask.select(yes.0[k], no.0[k]);
        }
        chosen
    }

    #[inline(always)]
    pub(in crate::engine::articulated) fn dot(&self, other: &Self) -> Lanes<S> {
        (self.0[0] * other.0[0]).add_product(self.0[1], other.0[1]).add_product(self.0[2], other.0[2])
    }

    #[inline(always)]
    pub(in crate::engine::articulated) fn cross(&self, other: &Self) -> Self {
        let ([a, b, c], [x, y, z]) = (self.0, other.0);
        V3([(b * z).sub_product(c, y), (c * x).sub_product(a, z), (a * y).sub_product(b, x)])
    }

    #[inline(always)]
    pub(in crate::engine::articulated) fn norm(&self) -> Lanes<S> {
        self.dot(self).sqrt()
    }

    #[inline(always)]
    pub(in crate::engine::articulated) fn times(&self, factor: Lanes<S>) -> Self {
        V3([self.0[0] * factor, self.0[1] * factor, self.0[2] * factor])
    }
}

impl<S: Simd> Add for V3<S> {
    type Output = Self;
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        V3([self.0[0] + other.0[0], self.0[1] + other.0[1], self.0[2] + other.0[2]])
    }
}

impl<S: Simd> Sub for V3<S> {
    type Output = Self;
    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        V3([self.0[0] - other.0[0], self.0[1] - other.0[1], self.0[2] - other.0[2]])
    }
}

impl<S: Simd> M3<S> {
    pub(in crate::engine::articulated) fn of(simd: S, matrix: impl Fn(usize) -> Matrix3<f64>) -> Self {
        M3([0, 1, 2].map(|i| [0, 1, 2].map(|j| Lanes::of(simd, |lane| matrix(lane)[(i, j)]))))
    }

    #[inline(always)]
    pub(in crate::engine::articulated) fn identity(simd: S) -> Self {
        M3([V3::axis(simd, 0).0, V3::axis(simd, 1).0, V3::axis(simd, 2).0])
    }

    #[inline(always)]
    pub(in crate::engine::articulated) fn row(&self, i: usize) -> V3<S> {
        V3(self.0[i])
    }

    #[inline(always)]
    pub(in crate::engine::articulated) fn column(&self, j: usize) -> V3<S> {
        V3([self.0[0][j], self.0[1][j], self.0[2][j]])
    }

    #[inline(always)]
    pub(in crate::engine::articulated) fn transform(&self, v: &V3<S>) -> V3<S> {
        V3([self.row(0).dot(v), self.row(1).dot(v), self.row(2).dot(v)])
    }

    /// Product of the transposed matrix and a vector.
    #[inline(always)]
    pub(in crate::engine::articulated) fn transform_transposed(&self, v: &V3<S>) -> V3<S> {
        V3([self.column(0).dot(v), self.column(1).dot(v), self.column(2).dot(v)])
    }

    #[inline(always)]
    pub(in crate::engine::articulated) fn product(&self, other: &Self) -> Self {
        let mut product = *self;
        for i in 0..3 {
            for j in 0..3 {
                product.0[i][j] = self.row(i).dot(&other.column(j));
            }
        }
        product
    }
}
