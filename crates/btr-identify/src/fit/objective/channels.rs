//! Where parameters show: the rows of their channels, what shares a rollout, and the blocks of a Jacobian.

use super::blocks::Block;
use super::{LogSet, Objective, blocks};
use crate::fit::residual_vector::ResidualVector;
use crate::fit::rollouts::{rows_near, shared};
use crate::residual_model::RecordedLog;
use btr_core::world::WorldError;
use nalgebra::DMatrix;
use rayon::prelude::*;
use std::ops::Range;

impl Objective<'_> {
    /// The rows of these channels in the residual of a set of logs.
    pub(crate) fn rows_near(&self, logs: LogSet, near: &[String]) -> Vec<Range<usize>> {
        let (mut start, mut rows) = (0, Vec::new());
        for log in self.logs(logs).iter().map(|&log| &self.description.logs[log]) {
            rows.extend(rows_near(log, near).into_iter().map(|of_log| start + of_log.start..start + of_log.end));
            start += log.rows();
        }
        rows
    }

    /// How many samples of these channels are present in some logs.
    pub(crate) fn present_near(&self, logs: LogSet, near: &[String]) -> usize {
        let logs = self.logs(logs).iter().map(|&log| &self.description.logs[log]);
        let channels = logs.flat_map(|log| &log.channels).filter(|channel| near.contains(&channel.name));
        channels.map(|channel| channel.present).sum()
    }

    /// The channels in which a parameter shows, where that is one of what acts in a joint of a prescribed motion, or in
    /// a limb; empty where it shows in all.
    pub(crate) fn channels_of(&self, parameter: usize) -> &[String] {
        self.own_channels.of(parameter)
    }

    /// The blocks of the training logs' Jacobian with respect to some parameters; none where it is dense.
    pub(in crate::fit) fn blocks(&self, active: &[usize]) -> Vec<Block> {
        self.blocks_of(&self.learn, active)
    }

    /// The same of some logs.
    fn blocks_of(&self, logs: &[usize], active: &[usize]) -> Vec<Block> {
        let logs: Vec<&RecordedLog> = logs.iter().map(|&log| &self.description.logs[log]).collect();
        self.own_channels.blocks(&logs, active)
    }

    /// JᵀJ of a Jacobian of the residual of some logs.
    pub(crate) fn curvature(&self, jacobian: &DMatrix<f64>, logs: &[usize], active: &[usize]) -> DMatrix<f64> {
        blocks::curvature(jacobian, &self.blocks_of(logs, active))
    }

    /// Residuals with each of some parameters moved, those that show in different channels in one rollout; the error of
    /// a rollout in the place of those that it was for. `usual` is the residual without a move, for the channels where
    /// a parameter does not show.
    pub(in crate::fit) fn moved(
        &self,
        points: &[(usize, Vec<f64>)],
        u: &[f64],
        usual: &[f64],
    ) -> Vec<Result<ResidualVector, WorldError>> {
        let alone = self.own_channels.hold_at(u);
        let channels_of = |parameter: usize| if alone { self.channels_of(parameter) } else { &[] };
        let groups = shared(points.iter().map(|(parameter, _)| channels_of(*parameter)));
        let together = |group: &Vec<usize>| {
            let mut point = u.to_vec();
            group.iter().for_each(|&k| point[points[k].0] = points[k].1[points[k].0]);
            point
        };
        let residuals = self.residuals(&groups.iter().map(together).collect::<Vec<_>>(), LogSet::Learn);
        let mut group_of = vec![0; points.len()];
        groups.iter().enumerate().for_each(|(number, group)| group.iter().for_each(|&k| group_of[k] = number));
        let of_point = |((parameter, _), &group): (&(usize, Vec<f64>), &usize)| {
            let residual = residuals[group].as_ref().map_err(Clone::clone)?;
            let near = channels_of(*parameter);
            if near.is_empty() {
                return Ok(residual.clone());
            }
            let mut own = usual.to_vec();
            let rows = self.rows_near(LogSet::Learn, near).into_iter();
            rows.for_each(|rows| own[rows.clone()].copy_from_slice(&residual[rows]));
            Ok(own)
        };
        points.par_iter().zip(&group_of).map(of_point).collect()
    }
}
