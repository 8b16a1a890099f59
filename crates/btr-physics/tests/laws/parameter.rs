//! Parameters change the quantities that they name.

use btr_physics::effects::PlacedEffect;
use btr_physics::model::parameter::{ParameterError, Target, apply};
use btr_physics::presets::ant;
use btr_physics::presets::ant::UNCERTAIN_LENGTHS;
use btr_physics::presets::nao::{UNCERTAIN_MASSES, nao};
use btr_physics::robot::urdf::parse_urdf;
use btr_physics::robot::{Actuator, Base, Geometry, Robot};
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
fn one_of_several_joints_with_an_effect_gets_a_value_of_its_own() {
    let mut robot = ant::ant();
    let armature = btr_physics::effects::find("armature").unwrap();
    let mut placed = vec![PlacedEffect { effect: armature, site: "*".to_owned(), values: vec![0.01] }];
    let target = Target::parse("armature.inertia@L1_knee", &robot).unwrap();
    assert_eq!(target.nominal(&robot, &placed, &Setup::default()), Some(0.01));
    target.set(0.03, &mut robot.clone(), &mut placed, &mut Setup::default());
    let at = |joint: &str| {
        let here = placed.iter().filter(|p| btr_physics::robot::site::matches(&p.site, joint));
        here.map(|p| p.values[0]).sum::<f64>()
    };
    assert_eq!((at("L1_knee"), at("R1_knee"), at("L1_yaw")), (0.03, 0.01, 0.01));
    // Both at once, again one by one, and as all that are left.
    let both = Target::parse("armature.inertia@L1_knee,R1_knee", &robot).unwrap();
    let mut two = vec![PlacedEffect { effect: armature, site: "R1_knee, L1_knee".to_owned(), values: vec![0.01] }];
    both.set(0.02, &mut robot, &mut two, &mut Setup::default());
    assert_eq!((two.len(), two[0].values[0]), (1, 0.02));
}

#[test]
fn joints_are_displaced_and_tilted_in_their_own_axes() {
    let (nominal, mut robot) = (nao(), nao());
    set("origin_y@RKneePitch", 0.01, &mut robot);
    set("tilt_x@RKneePitch", 0.1, &mut robot);
    set("inertia@RKneePitch", 2.0, &mut robot);
    let link = robot.link("RKneePitch").unwrap();
    let (before, after) = (&nominal.links[link], &robot.links[link]);
    let moved = after.joint.origin.translation.vector - before.joint.origin.translation.vector;
    assert!((moved - nalgebra::Vector3::new(0.0, 0.01, 0.0)).norm() < 1e-15);
    let turned = before.joint.origin.rotation.inverse() * after.joint.origin.rotation;
    assert!((turned.scaled_axis() - nalgebra::Vector3::new(0.1, 0.0, 0.0)).norm() < 1e-12);
    assert!((after.inertia_kg_m2 - before.inertia_kg_m2 * 2.0).norm() < 1e-15);
    assert_eq!(after.mass_kg.to_bits(), before.mass_kg.to_bits());
}

#[test]
fn a_joint_that_is_reversed_moves_the_other_way_with_its_stops_and_followers() {
    let text = r#"<robot name="grip"><link name="palm"/>{LINK a}{LINK b}
        <joint name="lead" type="revolute"><parent link="palm"/><child link="a"/><axis xyz="0 1 0"/>
        <limit lower="-0.2" upper="0.7" effort="1" velocity="1"/></joint>
        <joint name="other" type="revolute"><parent link="palm"/><child link="b"/><axis xyz="0 1 0"/>
        <mimic joint="lead" multiplier="2" offset="0.1"/><limit lower="-1" upper="2" effort="1" velocity="1"/></joint></robot>"#;
    let inertial =
        r#"<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>"#;
    let link = |text: &str, name: &str| {
        text.replace(&format!("{{LINK {name}}}"), &format!("<link name=\"{name}\">{inertial}</link>"))
    };
    let nominal = parse_urdf(&link(&link(text, "a"), "b"), Base::Fixed).unwrap().0;
    let with = |name: &str, value: f64| {
        let mut robot = nominal.clone();
        set(name, value, &mut robot);
        robot
    };
    assert_eq!(with("direction@lead", 1.0), nominal);
    let (lead, follower) = (nominal.link("a").unwrap(), nominal.link("b").unwrap());
    let robot = with("direction@lead", -1.0);
    let joint = &robot.links[lead].joint;
    assert_eq!((joint.axis, joint.limits), (-nominal.links[lead].joint.axis, (-0.7, 0.2)));
    let ratio = |robot: &Robot| robot.links[follower].joint.mimic.as_ref().map(|mimic| (mimic.ratio, mimic.offset));
    assert_eq!(ratio(&robot), Some((-2.0, 0.1)));
    assert_eq!(ratio(&with("direction@other", -1.0)), Some((-2.0, -0.1)));
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
        .chain(["damping@RKneePitch", "friction@L*"])
    {
        let (mut robot, mut placed, mut setup) = (nao(), Vec::new(), Setup::default());
        let target = Target::parse(name, &robot).unwrap();
        target.set(0.37, &mut robot, &mut placed, &mut setup);
        assert_eq!(target.nominal(&robot, &placed, &setup), Some(0.37), "{name}");
    }
}
