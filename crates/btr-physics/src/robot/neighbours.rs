//! The joints beside a joint in the chain.

use super::Robot;
use std::iter::successors;

/// Direction along the chain.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Side {
    /// Towards the base.
    Parent,
    /// Further out.
    Child,
}

/// The neighbours of a joint, as indices in [`Robot::movable`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Neighbours {
    /// The nearest movable joint towards the base.
    pub parent: Option<usize>,
    /// The next movable joint further out; where the chain branches, the first one in the robot's order.
    pub child: Option<usize>,
}

impl Neighbours {
    /// The neighbour on this side.
    pub fn on(&self, side: Side) -> Option<usize> {
        match side {
            Side::Parent => self.parent,
            Side::Child => self.child,
        }
    }
}

impl Robot {
    /// Whether the joint that carries a link has a neighbour on this side.
    pub(crate) fn has_neighbour(&self, link: usize, side: Side) -> bool {
        let joint = self.movable().position(|(moved, _)| moved == link);
        joint.and_then(|joint| self.neighbours().get(joint)?.on(side)).is_some()
    }

    /// The neighbours of each movable joint; the robot must be a tree.
    pub fn neighbours(&self) -> Vec<Neighbours> {
        let movable: Vec<usize> = self.movable().map(|(link, _)| link).collect();
        let place = |link: usize| movable.iter().position(|&moved| moved == link);
        let up = |link: usize| self.links.get(link)?.parent;
        let parent = |&link: &usize| successors(up(link), |&link| up(link)).find_map(place);
        let parents: Vec<Option<usize>> = movable.iter().map(parent).collect();
        let child = |joint: usize| parents.iter().position(|parent| *parent == Some(joint));
        parents.iter().enumerate().map(|(joint, &parent)| Neighbours { parent, child: child(joint) }).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::Neighbours;
    use crate::presets::ant;
    use crate::robot::{Joint, JointKind, Link, Robot};

    /// The ant, with a bracket that does not move between the first hip and its knee.
    fn bracketed_ant() -> Robot {
        let mut robot = ant::ant();
        let bracket = Link {
            name: "bracket".to_owned(),
            parent: Some(1),
            joint: Joint { kind: JointKind::Fixed, ..robot.links[1].joint.clone() },
            ..robot.links[1].clone()
        };
        robot.links.insert(2, bracket);
        for link in &mut robot.links[3..] {
            link.parent = link.parent.map(|parent| if parent >= 2 { parent + 1 } else { parent });
        }
        robot.links[3].parent = Some(2);
        robot
    }

    #[test]
    fn joints_that_do_not_move_are_skipped_and_legs_are_no_neighbours() {
        for robot in [ant::ant(), bracketed_ant()] {
            let neighbours = robot.neighbours();
            assert_eq!(neighbours.len(), robot.movable().count());
            assert_eq!(neighbours[0], Neighbours { parent: None, child: Some(1) });
            assert_eq!(neighbours[1].parent, Some(0));
            assert!(neighbours.iter().filter(|joint| joint.parent.is_none()).count() > 1, "several legs");
        }
    }

    #[test]
    fn the_first_of_several_children_is_the_neighbour() {
        let mut robot = bracketed_ant();
        robot.links.iter_mut().skip(2).for_each(|link| link.parent = Some(1));
        let neighbours = robot.neighbours();
        assert_eq!(neighbours[0], Neighbours { parent: None, child: Some(1) });
        assert!(neighbours[1..].iter().all(|joint| *joint == Neighbours { parent: Some(0), child: None }));
    }
}
