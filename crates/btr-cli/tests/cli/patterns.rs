//! Names with patterns in `[parameters]`.

use crate::lab::Lab;
use serde_json::Value;

/// Three links in the air, of which the last one carries a link without a mass.
pub(crate) const URDF: &str = r#"<robot name="arm">
<link name="base"><inertial><mass value="5"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>
<link name="upper"><inertial><origin xyz="0 0 -0.1"/><mass value="1"/>
<inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial></link>
<link name="fore"><inertial><origin xyz="0 0 -0.1"/><mass value="0.5"/>
<inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial></link>
<link name="hand"><inertial><mass value="0.1"/><inertia ixx="0.001" iyy="0.001" izz="0.001" ixy="0" ixz="0" iyz="0"/></inertial></link>
<link name="tip"/>
<joint name="hip" type="continuous"><parent link="base"/><child link="upper"/><axis xyz="0 1 0"/></joint>
<joint name="knee" type="continuous"><parent link="upper"/><child link="fore"/><origin xyz="0 0 -0.2"/><axis xyz="0 1 0"/>
</joint>
<joint name="thumb" type="continuous"><parent link="fore"/><child link="hand"/><origin xyz="0 0 -0.2"/><axis xyz="0 1 0"/>
</joint>
<joint name="glue" type="fixed"><parent link="hand"/><child link="tip"/></joint>
</robot>"#;

/// The model up to its parameters.
pub(crate) const MODEL: &str = r#"name = "arm"
[robot]
urdf = "arm.urdf"
base = "fixed"

# The servos.
[actuators."*"]
kind = "position"
kp = 20.0  # from the data sheet
kd = 0.5

[actuators.knee]
kind = "position"
kp = 10.0
kd = 0.4

[actuators.thumb]
kind = "passive"

[simulation]
control_s = 0.01
duration_s = 2.0

[noise]
position_rad = 0.001

[drive]
kind = "sine"
omega_rad_s = 5.0

[parameters]
"#;

/// A model with these parameters, and a log of it.
fn lab(parameters: &str) -> Lab {
    let lab = Lab::new();
    lab.write("arm.urdf", URDF);
    lab.write("arm.toml", &format!("{MODEL}{parameters}\n"));
    lab.write("plain.toml", &format!("{MODEL}\"kp@hip\" = {{ relative = [0.5, 2.0] }}\n"));
    lab.ok("simulate plain.toml -q --seed 3 -o log.csv");
    lab
}

/// The free parameters with their values.
fn free(lab: &Lab) -> Vec<(String, f64)> {
    // The thumb hangs loose, which is a finding.
    let checked: Value = serde_json::from_str(&lab.exits("check arm.toml log.csv --json", 1)).unwrap();
    let parameters = checked["parameters"].as_array().unwrap().iter();
    parameters.map(|p| (p["name"].as_str().unwrap().to_owned(), p["value"].as_f64().unwrap())).collect()
}

fn names(free: &[(String, f64)]) -> Vec<&str> {
    free.iter().map(|(name, _)| name.as_str()).collect()
}

#[test]
fn a_pattern_is_one_parameter_for_each_joint_that_has_the_value() {
    let by_pattern = free(&lab("\"kp@*\" = { relative = [0.8, 1.25] }\n\"kd@k*\" = { bounds = [0.1, 1.0] }"));
    assert_eq!(by_pattern, [("kp@hip".to_owned(), 20.0), ("kp@knee".to_owned(), 10.0), ("kd@knee".to_owned(), 0.4)]);
    let listed = lab("\"kp@hip,knee\" = { relative = [0.8, 1.25] }");
    assert_eq!(names(&free(&listed)), ["kp@hip", "kp@knee"]);
    // Links that are bolted down, or that weigh nothing, have no mass to find.
    assert_eq!(names(&free(&lab("\"mass@*\" = { relative = [0.8, 1.25] }"))), ["mass@upper", "mass@fore", "mass@hand"]);
}

#[test]
fn bounds_are_relative_to_the_value_of_each_joint() {
    let lab = lab("\"kp@*\" = { relative = [0.8, 1.25] }");
    let fitted = lab.ok("fit arm.toml log.csv -q -o fitted.toml");
    assert!(fitted.contains("kp@knee"), "{fitted}");
    let text: toml::Table = toml::from_str(&lab.read("fitted.toml")).unwrap();
    let bounds = |name: &str| text["parameters"][name]["bounds"].as_array().unwrap().clone();
    assert_eq!(bounds("kp@hip"), [16.0.into(), 25.0.into()]);
    assert_eq!(bounds("kp@knee"), [8.0.into(), 12.5.into()]);
}

#[test]
fn a_joint_with_an_entry_of_its_own_keeps_it() {
    let own = "\"kp@*\" = { relative = [0.8, 1.25] }\n\"kp@knee\" = { bounds = [1.0, 50.0], value = 12.0 }";
    assert_eq!(free(&lab(own)), [("kp@hip".to_owned(), 20.0), ("kp@knee".to_owned(), 12.0)]);
    assert_eq!(names(&free(&lab("\"kd@*,thumb\" = { bounds = [0.1, 2.0] }"))), ["kd@hip", "kd@knee"]);
}

#[test]
fn one_value_for_all_is_shared_and_an_effect_has_one() {
    let effects = "\"kd@hip,knee\" = { bounds = [0.1, 2.0], shared = true, value = 0.3 }\n\
                   \"viscous_friction.coefficient@*\" = { bounds = [0.0, 1.0], value = 0.1 }";
    assert_eq!(names(&free(&lab(effects))), ["kd@hip,knee", "viscous_friction.coefficient@*"]);
    // Relative to what the model states for single joints, or to the one value that it states.
    let relative = "\"armature.inertia@*\" = { relative = [0.5, 2.0] }\n";
    let apart = "[[effects]]\neffect = \"armature\"\nsite = \"hip\"\ninertia = 0.02\n\
                 [[effects]]\neffect = \"armature\"\nsite = \"knee\"\ninertia = 0.01\n";
    let each = [("armature.inertia@hip".to_owned(), 0.02), ("armature.inertia@knee".to_owned(), 0.01)];
    assert_eq!(free(&lab(&format!("{relative}{apart}"))), each);
    let together = "[[effects]]\neffect = \"armature\"\ninertia = 0.02\n";
    assert_eq!(free(&lab(&format!("{relative}{together}"))), [("armature.inertia@*".to_owned(), 0.02)]);
}

#[test]
fn a_pattern_that_matches_nothing_is_an_error_with_names_that_are_close() {
    let complaint = |parameters: &str| lab(parameters).complaint("check arm.toml log.csv");
    let unknown = complaint("\"kp@kne\" = { relative = [0.8, 1.25] }");
    assert!(unknown.contains("no movable joint `kne`; did you mean `knee`?"), "{unknown}");
    let unknown = complaint("\"kp@nkee*\" = { relative = [0.8, 1.25] }");
    assert!(
        unknown.contains("arm.toml:32") && unknown.contains("no movable joint `nkee*`; did you mean `knee`?"),
        "{unknown}"
    );
    let lacking = complaint("\"kp@thumb*\" = { relative = [0.8, 1.25] }");
    assert!(lacking.contains("the actuator of joint `thumb` has no such value"), "{lacking}");
    let nothing = complaint("\"mass@tip*\" = { relative = [0.8, 1.25] }");
    assert!(nothing.contains("`tip` has no mass"), "{nothing}");
    let twice = complaint("\"kp@*\" = { relative = [0.8, 1.25] }\n\"kp@k*\" = { relative = [0.8, 1.25] }");
    assert!(twice.contains("`kp@knee` is named twice"), "{twice}");
}

#[test]
fn what_a_pattern_frees_is_not_added_again() {
    let lab = lab("\"kp@*\" = { relative = [0.8, 1.25] }");
    let complaint = lab.complaint("add arm.toml kp@knee -o more.toml");
    assert!(complaint.contains("the model has `kp@knee` already"), "{complaint}");
    // A fit that begins at another model keeps the bounds of the pattern.
    lab.ok("fit arm.toml log.csv -q -o fitted.toml");
    lab.write("wide.toml", &lab.read("fitted.toml").replace("16.0, 25.0", "1.0, 99.0"));
    lab.ok("fit arm.toml log.csv -q --from wide.toml -o again.toml");
    assert!(lab.read("again.toml").contains("[16.0, 25.0]"), "{}", lab.read("again.toml"));
}
