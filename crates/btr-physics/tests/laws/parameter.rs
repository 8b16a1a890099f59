//! Parameters change the quantities that they name.

use btr_physics::effects::PlacedEffect;
use btr_physics::model::parameter::{ParameterError, Target, apply};
use btr_physics::presets::ant;
use btr_physics::presets::ant::UNCERTAIN_LENGTHS;
use btr_physics::presets::nao::{UNCERTAIN_MASSES, nao};
use btr_physics::robot::{Actuator, Geometry};
use btr_physics::setup::Setup;

fn set(name: &str, value: f64, robot: &mut btr_physics::robot::Robot) -> (Vec<PlacedEffect>, Setup) {
    let (mut placed, mut setup) = (Vec::new(), Setup::default());
    apply(&[Target::parse(name, robot).unwrap()], &[value], robot, &mut placed, &mut setup);
    (placed, setup)
}

#[test]
fn masses_of_the_nao() {
    for name in UNCERTAIN_MASSES {
        let mut robot = nao();
        let target = Target::parse(&format!("mass@{name}"), &robot).unwrap();
        let nominal = target.nominal(&robot, &[], &Setup::default()).unwrap();
        let link = robot.link(name).unwrap();
        let inertia = robot.links[link].inertia_kg_m2;
        set(target.name(), 1.5 * nominal, &mut robot);
        assert!((robot.mass_kg() - 4.34 - 0.5 * nominal).abs() < 1e-9);
        assert!((robot.links[link].inertia_kg_m2 - inertia * 1.5).norm() < 1e-12);
    }
}

#[test]
fn lengths_of_the_ant() {
    for name in UNCERTAIN_LENGTHS {
        let (nominal, mut robot) = (ant::ant(), ant::ant());
        set(&format!("length@{name}"), 1.25, &mut robot);
        let link = robot.link(name).unwrap();
        let (short, long) = (&nominal.links[link], &robot.links[link]);
        assert!((long.com_m.x / short.com_m.x - 1.25).abs() < 1e-12);
        assert!((long.mass_kg / short.mass_kg - 1.25).abs() < 1e-12);
        let half = |geometry: &Geometry| match geometry {
            Geometry::Capsule { half_length_m, .. } => *half_length_m,
            other => panic!("{other:?}"),
        };
        assert!((half(&long.shapes[0].geometry) / half(&short.shapes[0].geometry) - 1.25).abs() < 1e-12);
        if name.ends_with("femur") {
            assert!((robot.links[link + 1].joint.origin.translation.x - 0.1).abs() < 1e-12, "the knee moves out");
        }
    }
}

#[test]
fn stretching_by_one_changes_nothing_and_by_a_factor_stretches_the_inertia() {
    let (nominal, mut robot) = (ant::ant(), ant::ant());
    set("length@L1_femur", 1.0, &mut robot);
    let link = robot.link("L1_femur").unwrap();
    assert!((robot.links[link].inertia_kg_m2 - nominal.links[link].inertia_kg_m2).norm() < 1e-15);
    // The inertia of a thin rod grows with the cube of its length.
    let rod = Geometry::Cylinder { radius_m: 1e-6, half_length_m: 0.05 };
    let across = rod.inertia_kg_m2(0.3)[(0, 0)];
    robot.links[link].inertia_kg_m2 = nalgebra::Matrix3::from_diagonal(&nalgebra::Vector3::new(0.0, across, across));
    set("length@L1_femur", 2.0, &mut robot);
    assert!((robot.links[link].inertia_kg_m2[(1, 1)] / across - 8.0).abs() < 1e-6);
}

#[test]
fn motors_floors_and_effects() {
    let mut robot = ant::ant();
    set("kp@*_knee", 7.0, &mut robot);
    let kp = |joint: &str| {
        let link = robot.links.iter().find(|link| link.joint.name == joint).unwrap();
        match link.joint.actuator {
            Actuator::Position { kp, .. } => kp,
            ref other => panic!("{other:?}"),
        }
    };
    assert_eq!((kp("L1_knee"), kp("R3_knee"), kp("L1_yaw")), (7.0, 7.0, 12.0));
    let (_, setup) = set("ground_friction", 0.3, &mut robot);
    assert_eq!(setup.ground, Some(btr_physics::setup::Ground::hard(0.3)));
    let (placed, _) = set("coulomb_friction.torque@L1_knee,R1_knee", 0.2, &mut robot);
    assert_eq!((placed.len(), placed[0].values[0], placed[0].site.as_str()), (1, 0.2, "L1_knee,R1_knee"));
}

#[test]
fn unknown_names_get_similar_suggestions() {
    let robot = nao();
    let near = |name: &str| match Target::parse(name, &robot).unwrap_err() {
        ParameterError::Unknown { near, .. } | ParameterError::Site { near, .. } => near,
        other => panic!("{other}"),
    };
    assert_eq!(near("mas@Torso")[0], "mass");
    assert_eq!(near("coulomb_frction.torque@Torso")[0], "coulomb_friction.torque");
    assert!(near("mass@RKneePich").contains(&"RKneePitch".to_owned()));
    let absent = Target::parse("kt@RKneePitch", &robot).unwrap_err();
    assert!(absent.to_string().contains("RKneePitch"), "{absent}");
    assert!(Target::parse("length@LHipRoll", &robot).is_err(), "a ball has no long axis");
}

#[test]
fn every_quantity_is_read_back_where_it_was_set() {
    for name in ["mass@RKneePitch", "kp@R*", "kd@*", "ki@LKneePitch", "max_torque@*", "ground_friction"]
        .into_iter()
        .chain(["coulomb_friction.torque@RKneePitch", "payload.mass@base", "ground_friction.coefficient"])
    {
        let (mut robot, mut placed, mut setup) = (nao(), Vec::new(), Setup::default());
        let target = Target::parse(name, &robot).unwrap();
        target.set(0.37, &mut robot, &mut placed, &mut setup);
        assert_eq!(target.nominal(&robot, &placed, &setup), Some(0.37), "{name}");
    }
}
