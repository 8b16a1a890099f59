//! Construction of the engine from robots in their worlds: the tree of bodies, their shapes, the floor and the ball,
//! one candidate per lane.

pub(super) mod world;

use crate::engine::Dynamics;
use crate::engine::articulated::contacts;
use crate::engine::articulated::contacts::{BallShape, Form, Hull};
use crate::engine::articulated::impulses::Impulses;
use crate::engine::articulated::joint_forces::JointForces;
use crate::engine::articulated::linear_algebra::lanes::Lanes;
use crate::engine::articulated::linear_algebra::spatial::{Spatial, Symmetric};
use crate::engine::articulated::linear_algebra::vectors::{M3, V3};
use crate::engine::articulated::state::{Articulated, Coupling, Floor, JointStates, Scratch};
use crate::engine::articulated::tree::{Configuration, Pose, Tree, TreeBody};
use crate::robot::{Geometry, Robot};
use crate::setup::Setup;
use nalgebra::Vector3;
use pulp::{Arch, Scalar, Simd};
use std::sync::OnceLock;
use world::{World, WorldBody, WorldShape};

/// Number of SIMD lanes on this machine.
pub(crate) fn lanes() -> usize {
    widths().first().map_or(1, |arch| width(*arch))
}

/// The most lanes to use: what the environment variable `BTR_LANES` says, or all that the machine has. It changes the
/// time alone, and is there to show that.
fn most_lanes() -> usize {
    static MOST: OnceLock<usize> = OnceLock::new();
    let stated = || std::env::var("BTR_LANES").ok()?.trim().parse().ok();
    *MOST.get_or_init(|| stated().unwrap_or(usize::MAX).max(1))
}

/// The instruction sets of this machine that may be used, the widest first; the last one has a single lane.
pub(crate) fn widths() -> Vec<Arch> {
    #[cfg(target_arch = "x86_64")]
    let wide = [pulp::x86::V4::try_new().map(Arch::V4), pulp::x86::V3::try_new().map(Arch::V3)];
    #[cfg(not(target_arch = "x86_64"))]
    let wide = [None];
    wide.into_iter().flatten().chain([Arch::Scalar]).filter(|arch| width(*arch) <= most_lanes()).collect()
}

/// Number of lanes of an instruction set.
pub(crate) fn width(arch: Arch) -> usize {
    match arch {
        #[cfg(target_arch = "x86_64")]
        Arch::V4(_) => pulp::x86::V4::F64_LANES,
        #[cfg(target_arch = "x86_64")]
        Arch::V3(_) => pulp::x86::V3::F64_LANES,
        _ => 1,
    }
}

/// The engine for one robot in its start state.
pub(crate) fn engine(robot: &Robot, setup: &Setup) -> Box<dyn Dynamics> {
    Box::new(Articulated::new(Scalar::new(), Arch::new(), &[World::new(robot, setup)]))
}

/// The engine for several candidates; takes as many of the first as it has lanes. `None` if they differ in structure.
pub(crate) fn engine_of_several(arch: Arch, candidates: &[(&Robot, &Setup)]) -> Option<Box<dyn Dynamics>> {
    let worlds: Vec<World> = candidates.iter().map(|(robot, setup)| World::new(robot, setup)).collect();
    let alike = worlds.iter().all(|world| world.is_like(&worlds[0]));
    alike.then(|| -> Box<dyn Dynamics> {
        match arch {
            #[cfg(target_arch = "x86_64")]
            Arch::V4(simd) => Box::new(Articulated::new(simd, arch, &worlds)),
            #[cfg(target_arch = "x86_64")]
            Arch::V3(simd) => Box::new(Articulated::new(simd, arch, &worlds)),
            _ => Box::new(Articulated::new(Scalar::new(), arch, &worlds)),
        }
    })
}

impl<S: Simd> Articulated<S> {
    /// Robots of the same structure in their start states; the last one fills the lanes that are left over.
    pub(in crate::engine::articulated) fn new(simd: S, arch: Arch, worlds: &[World]) -> Self {
        let worlds: Vec<&World> = worlds.iter().take(S::F64_LANES).collect();
        let at = |lane: usize| worlds[lane.min(worlds.len() - 1)];
        let (one, lanes) = (at(0), |number: &dyn Fn(&World) -> f64| Lanes::of(simd, |lane| number(at(lane))));
        let bodies = (0..one.bodies.len()).map(|i| TreeBody::of(simd, |lane| &at(lane).bodies[i])).collect();
        let bolted = |lane: usize| at(lane).start.rotation.to_rotation_matrix().into_inner();
        let root = (M3::of(simd, bolted), V3::of(simd, |lane| at(lane).start.translation.vector));
        let tree = Tree::new(simd, bodies, root);
        let joints = 0..one.q.len();
        let mut u = vec![Lanes::zero(simd); tree.freedom()];
        joints.clone().for_each(|i| u[one.root + i] = lanes(&|world| world.dq[i]));
        let now = Configuration {
            q: joints.clone().map(|i| lanes(&|world| world.q[i])).collect(),
            poses: (0..one.poses.len()).map(|i| Pose::of(simd, |lane| at(lane).poses[i])).collect(),
            u,
        };
        let hulls: Vec<Hull<S>> = (0..one.hulls.len()).map(|i| Hull::of(simd, |lane| &at(lane).hulls[i])).collect();
        let nothing = Lanes::zero(simd);
        let inner = JointForces {
            constant: nothing,
            stiffness: nothing,
            damping: nothing,
            dry_friction: nothing,
            creep: [nothing; 2],
            armature: nothing,
        };
        let touchable = one.setup.ground.is_some() || one.setup.ball.is_some();
        let mut engine = Articulated {
            simd,
            arch,
            lane: 0,
            joint_states: worlds.iter().map(|world| JointStates { q: world.q.clone(), dq: world.dq.clone() }).collect(),
            before: now.u.clone(),
            root: one.root,
            fixed: worlds.iter().map(|world| world.start).collect(),
            inner: vec![inner; one.q.len()],
            motors: (0..one.q.len()).map(|_| None).collect(),
            prescribed: vec![None; one.q.len()],
            limits: joints.map(|i| (lanes(&|world| world.limits[i].0), lanes(&|world| world.limits[i].1))).collect(),
            followers: (0..one.followers.len())
                .map(|k| Coupling {
                    joint: one.followers[k].joint,
                    leader: one.followers[k].leader,
                    ratio: lanes(&|world| world.followers[k].ratio),
                    offset: lanes(&|world| world.followers[k].offset),
                })
                .collect(),
            names: one.names.clone(),
            gravity: V3::of(simd, |lane| at(lane).setup.gravity_m_s2),
            dt_s: one.setup.dt_s / one.setup.substeps as f64,
            substeps: one.setup.substeps,
            floor: touchable.then(|| Floor {
                friction: one.setup.ground.map(|_| lanes(&|world| world.setup.ground.map_or(0.0, |g| g.friction))),
                stiffness: lanes(&|world| world.compliance().stiffness),
                damping: lanes(&|world| world.compliance().damping),
            }),
            impulses: Impulses::new(simd, contacts::slots(&hulls)),
            ball: one.setup.ball.is_some().then(|| BallShape::of(simd, one.bodies.len() - 1, |lane| at(lane))),
            hulls,
            rolling_damping: lanes(&|world| world.setup.ball.map_or(0.0, |ball| ball.rolling_damping_per_s)),
            foot_impulses: vec![nothing; one.feet],
            diverged: nothing.less(nothing),
            scratch: Scratch::new(simd, &now, one.bodies.len()),
            tree,
            now,
        };
        engine.publish_states();
        engine
    }
}

impl<S: Simd> TreeBody<S> {
    fn of<'a>(simd: S, plain: impl Fn(usize) -> &'a WorldBody) -> Self {
        let rotation = |lane: usize| plain(lane).origin.rotation.to_rotation_matrix().into_inner();
        // R(q) = 1 + sin q·K + (1 − cos q)·K², with the cross product K of the axis (O. Rodrigues).
        let cross = |lane: usize| plain(lane).axis.cross_matrix();
        let inertia = |i: usize, j: usize| Lanes::of(simd, |lane| plain(lane).inertia_kg_m2[(i, j)]);
        TreeBody {
            parent: plain(0).parent,
            carrier: plain(0).carrier,
            rotation: M3::of(simd, rotation),
            place: V3::of(simd, |lane| plain(lane).origin.translation.vector),
            axis: V3::of(simd, |lane| rotation(lane) * plain(lane).axis),
            rodrigues: [
                M3::of(simd, |lane| rotation(lane) * cross(lane)),
                M3::of(simd, |lane| rotation(lane) * cross(lane) * cross(lane)),
            ],
            mass: Lanes::of(simd, |lane| plain(lane).mass_kg),
            com: V3::of(simd, |lane| plain(lane).com_m),
            inertia: Symmetric([
                inertia(0, 0),
                inertia(1, 1),
                inertia(2, 2),
                inertia(0, 1),
                inertia(0, 2),
                inertia(1, 2),
            ]),
        }
    }
}

impl<S: Simd> Hull<S> {
    fn of<'a>(simd: S, shape: impl Fn(usize) -> &'a WorldShape) -> Self {
        let number = |of: fn(&Geometry) -> f64| Lanes::of(simd, |lane| of(&shape(lane).geometry));
        let radius = || {
            number(|geometry| match geometry {
                Geometry::Sphere { radius_m }
                | Geometry::Cylinder { radius_m, .. }
                | Geometry::Capsule { radius_m, .. } => *radius_m,
                Geometry::Box { .. } => f64::NAN,
            })
        };
        let half_length = || {
            number(|geometry| match geometry {
                Geometry::Cylinder { half_length_m, .. } | Geometry::Capsule { half_length_m, .. } => *half_length_m,
                Geometry::Box { .. } | Geometry::Sphere { .. } => f64::NAN,
            })
        };
        let half = |lane: usize| match shape(lane).geometry {
            Geometry::Box { half_m } => half_m,
            _ => Vector3::zeros(),
        };
        let form = match shape(0).geometry {
            Geometry::Box { .. } => Form::Box { half: V3::of(simd, half) },
            Geometry::Sphere { .. } => Form::Sphere { radius: radius() },
            Geometry::Cylinder { .. } => Form::Cylinder { radius: radius(), half_length: half_length() },
            Geometry::Capsule { .. } => Form::Capsule { radius: radius(), half_length: half_length() },
        };
        Hull {
            body: shape(0).body,
            foot: shape(0).foot,
            centre: V3::of(simd, |lane| shape(lane).pose.translation.vector),
            rotation: M3::of(simd, |lane| shape(lane).pose.rotation.to_rotation_matrix().into_inner()),
            form,
            reach: number(reach_m),
        }
    }
}

/// Bounding radius of a shape about its centre, in m.
fn reach_m(geometry: &Geometry) -> f64 {
    match geometry {
        Geometry::Box { half_m } => half_m.norm(),
        Geometry::Sphere { radius_m } => *radius_m,
        Geometry::Cylinder { radius_m, half_length_m } => radius_m.hypot(*half_length_m),
        Geometry::Capsule { radius_m, half_length_m } => radius_m + half_length_m,
    }
}

impl<S: Simd> BallShape<S> {
    fn of<'a>(simd: S, body: usize, world: impl Fn(usize) -> &'a World) -> Self {
        let number = |of: fn(&Setup) -> Option<f64>| Lanes::of(simd, |lane| of(&world(lane).setup).unwrap_or(0.0));
        BallShape {
            body,
            radius: number(|setup| setup.ball.map(|ball| ball.radius_m)),
            friction: number(|setup| {
                setup.ball.map(|ball| 0.5 * (ball.friction + setup.ground.map_or(0.0, |ground| ground.friction)))
            }),
            restitution: number(|setup| setup.ball.map(|ball| 0.5 * ball.restitution)),
        }
    }
}

impl<S: Simd> Scratch<S> {
    fn new(simd: S, now: &Configuration<S>, bodies: usize) -> Self {
        let (n, zero) = (now.u.len(), Lanes::zero(simd));
        Scratch {
            middle: now.clone(),
            matrix: vec![zero; n * n],
            bias_forces: vec![zero; n],
            next: vec![zero; n],
            mean: vec![zero; n],
            implicitness: vec![zero; n],
            contact_points: Vec::new(),
            motions: [0, 1].map(|_| vec![Spatial::zero(simd); bodies]),
            known: Vec::with_capacity(n),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::engine::{Affine, Dof};
    use crate::presets::ant;

    /// Two ants; only the second one has weak springs.
    fn two_ants<S: Simd>(simd: S, arch: Arch) {
        let (robot, setup) = (ant::ant(), Setup::default());
        let mut engine = Articulated::new(simd, arch, &[World::new(&robot, &setup), World::new(&robot, &setup)]);
        for lane in 0..2 {
            engine.select_lane(lane);
            let torque = Affine { stiffness: 20.0 / (1.0 + 99.0 * lane as f64), damping: 0.1, constant: 0.0 };
            (0..engine.inner.len()).for_each(|joint| engine.set_joint(joint, &Dof { torque, ..Dof::default() }));
        }
        (0..100).for_each(|_| engine.step());
        let differ = |a: usize, b: usize| engine.now.q.iter().any(|q| q.lane(a).to_bits() != q.lane(b).to_bits());
        assert!(differ(0, 1) && (2..S::F64_LANES).all(|lane| !differ(1, lane)), "{arch:?}");
    }

    #[test]
    fn lanes_without_a_candidate_do_as_the_last_one_does() {
        for arch in widths() {
            match arch {
                #[cfg(target_arch = "x86_64")]
                Arch::V4(simd) => two_ants(simd, arch),
                #[cfg(target_arch = "x86_64")]
                Arch::V3(simd) => two_ants(simd, arch),
                _ => {}
            }
        }
    }
}
