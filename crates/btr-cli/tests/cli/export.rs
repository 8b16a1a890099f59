//! Models in the files of other simulators.

use crate::lab::{Lab, robots, text};
use std::fmt::Write;

/// The desk arm with a payload, friction, a rotor, a limit and a dead time.
fn lab() -> Lab {
    let lab = Lab::new();
    lab.write("arm.urdf", &std::fs::read_to_string(robots().join("arm.urdf")).unwrap());
    let model = std::fs::read_to_string(robots().join("arm.toml")).unwrap().replace("kd = 0.25", "kd = 0.25\nki = 0.5");
    let found = r#"
"viscous_friction.coefficient@shoulder" = { bounds = [0.0, 2.0], value = 0.21 }
"coulomb_friction.torque@elbow" = { bounds = [0.0, 2.0], value = 0.13 }
"origin_z@elbow" = { bounds = [-0.1, 0.1], value = 0.002 }
"end_payload.mass@forearm" = { bounds = [0.0, 2.0], value = 0.35 }
"armature.inertia@yaw" = { bounds = [0.0, 0.1], value = 0.02 }
"torque_limit.torque@shoulder" = { bounds = [1.0, 20.0], value = 7.5 }
"command_delay.delay@elbow" = { bounds = [0.0, 0.1], value = 0.0151 }
"cogging.amplitude@yaw" = { bounds = [-1.0, 1.0], value = 0.08 }
"cogging.order@yaw" = { bounds = [1.0, 40.0], value = 12.0 }
"#;
    lab.write("fitted.toml", &(model.replace("#:schema ../btr.schema.json\n", "") + found));
    lab
}

const MJCF: &str = r#"<mujoco model="arm">
  <!-- as the lab built it -->
  <compiler angle="radian"/>
  <worldbody>
    <body name="turret">
      <joint name="yaw" axis="0 0 1"/>  <!-- slow -->
      <body name="upper" pos="0 0 0.1">
        <joint name="shoulder" axis="0 1 0" damping="0.2"/>
        <body name="forearm" pos="0 0 0.3">
          <joint name="elbow" axis="0 1 0" pos="0 0 0.01"/>
          <inertial pos="0 0 0.1" mass="0.3" diaginertia="1e-3 1e-3 1e-4" quat="1 0 0 0"/>
        </body>
      </body>
    </body>
  </worldbody>
  <actuator>
    <position name="yaw_servo" joint="yaw" kp="20" kv="0.5"/>
    <general joint="shoulder" gear="2"/>
  </actuator>
</mujoco>
"#;

/// The lines in which two texts differ.
fn difference(before: &str, after: &str) -> String {
    let mut said = String::new();
    for (before, after) in before.lines().zip(after.lines()).filter(|(before, after)| before != after) {
        writeln!(said, "-{before}\n+{after}").unwrap();
    }
    assert_eq!(before.lines().count(), after.lines().count());
    said
}

/// The lines of one text that are not in another.
fn difference_of_lines(before: &str, after: &str) -> String {
    let lines = |text: &str, other: &str, sign: char| -> String {
        text.lines().filter(|line| !other.lines().any(|known| known == *line)).map(|l| format!("{sign}{l}\n")).collect()
    };
    lines(before, after, '-') + &lines(after, before, '+')
}

/// MuJoCo's compiler makes one body of links that are fixed to each other.
#[test]
fn a_body_has_the_mass_of_the_links_that_were_fused_into_it() {
    let lab = lab();
    let tool = r#"<link name="tool"><inertial><origin xyz="0 0 0.02"/><mass value="0.1"/>
        <inertia ixx="1e-5" iyy="1e-5" izz="1e-5" ixy="0" ixz="0" iyz="0"/></inertial></link>
        <joint name="flange" type="fixed"><parent link="forearm"/><child link="tool"/><origin xyz="0 0 0.3" rpy="0 0 1"/></joint>
        </robot>"#;
    lab.write("arm.urdf", &lab.read("arm.urdf").replace("</robot>", tool));
    let mass_and_height = |mjcf: &str| {
        lab.write("arm.xml", mjcf);
        lab.ok("export fitted.toml arm.xml --to mujoco -o out.xml");
        let text = lab.read("out.xml");
        let body = text.split("<body name=\"forearm\"").nth(1).unwrap();
        let inertial = body.split("<inertial").nth(1).unwrap().split("/>").next().unwrap();
        let value =
            |name: &str| inertial.split(&format!("{name}=\"")).nth(1).unwrap().split('"').next().unwrap().to_owned();
        let number = |text: &str| text.parse::<f64>().unwrap();
        (number(&value("mass")), number(value("pos").split(' ').nth(2).unwrap()) - 0.01)
    };
    let own = "<body name=\"tool\" pos=\"0 0 0.3\"><inertial pos=\"0 0 0.02\" mass=\"0.1\" diaginertia=\"1e-5 1e-5 1e-5\"/></body>\n";
    let (apart, apart_z) =
        mass_and_height(&MJCF.replace("quat=\"1 0 0 0\"/>\n", &format!("quat=\"1 0 0 0\"/>\n{own}")));
    let (fused, fused_z) = mass_and_height(MJCF);
    assert!((fused - apart - 0.1).abs() < 1e-9, "{fused} {apart}");
    assert!((fused * fused_z - apart * apart_z - 0.1 * 0.32).abs() < 1e-6, "{fused_z} {apart_z}");
}

#[test]
fn mujoco_s_file_changes_in_its_numbers_alone() {
    let lab = lab();
    lab.write("arm.xml", MJCF);
    insta::assert_snapshot!("export_mujoco", lab.ok("export fitted.toml arm.xml --to mujoco -o out.xml"));
    insta::assert_snapshot!("export_mujoco_difference", difference(MJCF, &lab.read("out.xml")));
    insta::assert_snapshot!("export_effects", lab.read("out.effects.json"));
    // What is exported again changes no more.
    lab.ok("export fitted.toml out.xml --to mujoco -o again.xml");
    assert_eq!(lab.read("out.xml"), lab.read("again.xml"));
}

/// The same robot on a base that is fixed to the world: joints and servos have most of their values from classes.
const CLASSES: &str = r#"<mujoco model="arm">
  <default>
    <joint damping="0.21"/>
    <position kp="25" kv="0.6"/>
    <default class="weak">
      <joint armature="0.02" frictionloss="0.05"/>
      <position kp="20"/>
      <default class="weaker"><joint frictionloss="0.13"/></default>
    </default>
  </default>
  <worldbody>
    <body name="base">
      <body name="turret" childclass="weak">
        <joint name="yaw" damping="0" frictionloss="0"/>
        <body name="upper">
          <joint name="shoulder" damping="0.3"/>
          <body name="forearm" childclass="weaker"><frame><joint name="elbow"/></frame></body>
        </body>
      </body>
    </body>
  </worldbody>
  <actuator>
    <position class="weak" joint="yaw" kv="0.5"/>
    <position joint="shoulder" forcerange="-7.5 7.5"/>
    <position class="gone" joint="elbow" dampratio="1"/>
  </actuator>
</mujoco>
"#;

#[test]
fn what_classes_give_and_what_cannot_act_is_not_written_again() {
    let lab = lab();
    let heavier = "\n[links.base]\nmass_kg = 9.0\ncom_m = [0, 0, 0]\ninertia_kg_m2 = [1, 1, 1, 0, 0, 0]\n";
    lab.write("fitted.toml", &(lab.read("fitted.toml") + heavier));
    lab.write("arm.xml", CLASSES);
    insta::assert_snapshot!("export_mujoco_classes", lab.ok("export fitted.toml arm.xml --to mujoco -o out.xml"));
    insta::assert_snapshot!("export_mujoco_classes_difference", difference_of_lines(CLASSES, &lab.read("out.xml")));
    // On a base that moves, its mass acts.
    let free = CLASSES.replace("<body name=\"base\">", "<body name=\"base\"><freejoint/>");
    lab.write("free.xml", &free);
    assert!(lab.ok("export fitted.toml free.xml --to mujoco -o out.xml").contains("base: mass 9.0000 kg"));
}

#[test]
fn what_a_model_states_of_its_links_is_exported() {
    let lab = lab();
    let stated = "\n[links.upper]\nmass_kg = 1.25\ncom_m = [0, 0, 0.1]\ninertia_kg_m2 = [0.01, 0.01, 0.01, 0, 0, 0]\n";
    lab.write("fitted.toml", &(lab.read("fitted.toml") + stated));
    lab.write("arm.xml", MJCF);
    assert!(lab.ok("export fitted.toml arm.xml --to mujoco -o out.xml").contains("upper: mass 1.2500 kg"));
    assert!(lab.ok("export fitted.toml --to urdf -o out.urdf").contains("upper: mass 1.2500 kg"));
}

#[test]
fn a_longer_time_step_than_the_model_s_and_an_integrator_of_first_order_are_told() {
    let lab = lab();
    let advice = |option: &str| {
        lab.write("arm.xml", &MJCF.replace("  <worldbody>", &format!("  {option}<worldbody>")));
        let document = lab.json("export fitted.toml arm.xml --to mujoco -o out.xml");
        let lines = document["advice"].as_array().unwrap().iter();
        lines.map(|line| line.as_str().unwrap().to_owned()).collect::<Vec<_>>()
    };
    let told = advice("");
    assert_eq!(told.len(), 2);
    insta::assert_snapshot!("export_time_step", told.join("\n"));
    assert!(advice("<option timestep=\"0.005\"/>")[0].starts_with("timestep: 0.005 s in the file, and 0.001 s"));
    assert!(
        advice("<option timestep=\"0.001\" integrator=\"implicit\"/>")[0].starts_with("integrator: implicit, errs")
    );
    for silent in [
        "<option timestep=\"0.001\" integrator=\"RK4\"/>",
        "<option integrator=\"RK4\" timestep=\"0.0005\"/>",
        "<include file=\"scene.xml\"/>",
    ] {
        assert_eq!(advice(silent), Vec::<String>::new(), "{silent}");
    }
    assert!(!lab.read("out.xml").contains("timestep"));
    // A stiffer servo settles within fewer of the model's steps.
    lab.write("fitted.toml", &lab.read("fitted.toml").replace("kd = 0.25", "kd = 25.0"));
    let told = &advice("<option timestep=\"0.001\" integrator=\"RK4\"/>")[0];
    assert!(told.starts_with("timestep: 0.001 s in the file, and elbow settles within "), "{told}");
    assert!(!told.contains("timestep=\"0.001\""), "{told}");
}

#[test]
fn what_replays_a_log_with_the_effects_that_are_left_is_printed() {
    let lab = lab();
    lab.write("arm.xml", MJCF);
    let told = lab.ok("export fitted.toml arm.xml --to mujoco -o out.xml");
    for line in [
        "btr.mujoco.EffectStepper applies them",
        "  model = mujoco.MjModel.from_xml_path(\"out.xml\")",
        "  log = btr.load_log(\"LOG\", model=btr.load_model(\"fitted.toml\"))",
        "  print(btr.mujoco.replay(model, log, \"out.effects.json\"))",
    ] {
        assert!(told.contains(line), "{told}");
    }
    assert!(!lab.ok("export fitted.toml --to urdf -o out.urdf").contains("EffectStepper"));
}

#[test]
fn a_limit_of_the_file_that_the_model_lacks_is_told() {
    let lab = lab();
    let told = |range: &str| {
        let yaw = format!("<joint name=\"yaw\" actuatorfrcrange=\"{range}\"");
        lab.write("arm.xml", &MJCF.replace("<joint name=\"yaw\"", &yaw));
        lab.ok("export fitted.toml arm.xml --to mujoco -o out.xml").contains("yaw: actuatorfrcrange limits")
    };
    assert!(told("-2 2") && !told("0 0"));
}

#[test]
fn an_exported_urdf_moves_as_the_model() {
    let lab = lab();
    insta::assert_snapshot!("export_urdf", lab.ok("export fitted.toml --to urdf -o out.urdf"));
    let fitted = lab.read("fitted.toml");
    let before = |name: &str| fitted.find(name).unwrap();
    // The same servos, with what URDF cannot say.
    let carried = ["viscous_friction", "coulomb_friction", "end_payload"];
    let rest: String = fitted
        .lines()
        .filter(|line| !carried.iter().any(|name| line.starts_with(&format!("\"{name}."))))
        .fold(String::new(), |text, line| text + line + "\n");
    assert!(before("[parameters]") < before("viscous_friction"));
    lab.write("other.toml", &rest.replace("arm.urdf", "out.urdf"));
    let log = robots().join("arm/learn_1.csv");
    let simulated = |model: &str| {
        lab.ok(&format!("simulate {model} --log {} -o {model}.csv", log.display()));
        let rows = lab.read(&format!("{model}.csv"));
        let cells = |line: &str| line.split(',').map(|cell| cell.parse::<f64>().unwrap()).collect::<Vec<_>>();
        rows.lines().skip(1).map(cells).collect::<Vec<_>>()
    };
    let (one, other) = (simulated("fitted.toml"), simulated("other.toml"));
    assert!(one.len() > 100);
    let apart = one.iter().flatten().zip(other.iter().flatten()).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    // Numbers are written with ten digits.
    assert!(apart < 1e-6, "{apart}");
}

#[test]
fn actuators_and_limits_are_written_for_isaac_lab_and_ros() {
    let lab = lab();
    insta::assert_snapshot!("export_isaac_lab", lab.ok("export fitted.toml --to isaac-lab -o actuators.py"));
    insta::assert_snapshot!("export_isaac_lab_file", lab.read("actuators.py"));
    insta::assert_snapshot!("export_ros2", lab.ok("export fitted.toml --to ros2 -o limits.yaml"));
    insta::assert_snapshot!("export_ros2_file", lab.read("limits.yaml"));
    let document = lab.json("export fitted.toml --to isaac-lab --step 0.05 -o slow.py");
    let left = document["left"].as_array().unwrap();
    assert!(left.iter().any(|line| line.as_str().unwrap().contains("below half a step")), "{left:?}");
}

#[test]
fn what_cannot_be_exported_is_refused_in_a_word() {
    let lab = lab();
    lab.write("text.xml", "no elements");
    lab.write("other.xml", "<robot name=\"arm\"/>");
    lab.write("stranger.xml", "<mujoco><worldbody><body><joint name=\"tail\"/></body></worldbody></mujoco>");
    lab.write("deep.xml", &("<mujoco>".repeat(200_000) + &"</mujoco>".repeat(200_000)));
    let complaints: Vec<String> = [
        "export fitted.toml --to mujoco -o out.xml",
        "export fitted.toml text.xml --to mujoco -o out.xml",
        "export fitted.toml other.xml --to mujoco -o out.xml",
        "export fitted.toml missing.xml --to mujoco -o out.xml",
        "export fitted.toml stranger.xml --to mujoco -o out.xml",
        "export fitted.toml arm.urdf --to urdf -o arm.urdf",
        "export fitted.toml --to urdf -o out.toml",
        "export fitted.toml --to gazebo -o out.sdf",
    ]
    .map(|arguments| lab.complaint(arguments))
    .into();
    insta::assert_snapshot!("export_refused", complaints.join("---\n"));
    // Nested without end: a word or a file, but no crash.
    let output = lab.run("export fitted.toml deep.xml --to mujoco -o out.xml");
    assert!(output.status.code().is_some(), "{}", text(&output.stderr));
}

/// What a fit of three parameters leaves: rotor and dead time are known, friction is not.
const FIT: &str = r#"{ "ok": true, "posterior": { "has_structure": false, "parameters": [
  { "name": "armature.inertia@yaw", "coordinate": "linear", "mean": 0.02, "sd": 0.001, "min": 0.0, "max": 0.1 },
  { "name": "command_delay.delay@elbow", "coordinate": "linear", "mean": 0.0151, "sd": 0.003, "min": 0.0, "max": 0.1 },
  { "name": "viscous_friction.coefficient@shoulder", "coordinate": "linear", "mean": 0.21, "sd": 0.05, "min": 0.0,
    "max": 2.0 }
], "correlation": [[1.0, 0.0, -0.95], [0.0, 1.0, 0.0], [-0.95, 0.0, 1.0]] } }"#;

#[test]
fn isaac_lab_gets_ranges_of_what_is_uncertain() {
    let lab = lab();
    lab.write("fit.json", FIT);
    lab.ok("export fitted.toml --to isaac-lab -o sure.py");
    lab.ok("export fitted.toml --to isaac-lab -o ranges.py --randomize fit.json");
    let (sure, ranges) = (lab.read("sure.py"), lab.read("ranges.py"));
    let new: Vec<&str> = ranges.lines().filter(|line| !sure.lines().any(|known| known == *line)).collect();
    insta::assert_snapshot!("export_isaac_lab_ranges", new.join("\n"));
}

#[test]
fn what_is_0_and_uncertain_is_told_where_ranges_are_factors() {
    let lab = lab();
    let zero =
        lab.read("fitted.toml").replace("value = 0.02 }", "value = 0.0 }").replace("value = 0.21 }", "value = 0.0 }");
    lab.write("fitted.toml", &zero);
    lab.write("fit.json", &FIT.replace("\"mean\": 0.02", "\"mean\": 0.0").replace("\"mean\": 0.21", "\"mean\": 0.0"));
    let told = lab.ok("export fitted.toml --to isaac-lab -o ranges.py --randomize fit.json");
    let lines: Vec<&str> = told.lines().filter(|line| line.contains("terms only scale it")).collect();
    insta::assert_snapshot!("export_isaac_lab_zeros", lines.join("\n"));
    assert!(!lab.read("ranges.py").contains("armature_distribution_params"));
}

#[test]
fn a_bound_that_is_infinite_in_its_coordinate_is_none() {
    let lab = lab();
    let limit = r#"{ "name": "torque_limit.torque@shoulder", "coordinate": "inverse", "mean": 0.1333, "sd": 0.01,
      "min": 0.05, "max": null }"#;
    let fit = FIT.replace("\"parameters\": [", &format!("\"parameters\": [{limit},"));
    let of_four = "[[1,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]]";
    lab.write("fit.json", &fit.replace("[[1.0, 0.0, -0.95], [0.0, 1.0, 0.0], [-0.95, 0.0, 1.0]]", of_four));
    lab.write("arm.xml", MJCF);
    lab.ok("export fitted.toml arm.xml --to mujoco -o out.xml --randomize fit.json --draws 2");
    assert_ne!(lab.read("out.000.xml"), lab.read("out.001.xml"));
}

#[test]
fn draws_are_files_that_keep_correlations() {
    let lab = lab();
    lab.write("fit.json", FIT);
    lab.write("arm.xml", MJCF);
    let told = lab.ok("export fitted.toml arm.xml --to mujoco -o out.xml --randomize fit.json --draws 30");
    assert!(told.contains("out.000.xml to out.029.xml: draws from what the fit leaves"), "{told}");
    let number = |text: &str, before: &str| {
        let rest = text.split_once(before).unwrap().1;
        rest.split('"').next().unwrap().parse::<f64>().unwrap()
    };
    let values: Vec<(f64, f64)> = (0..30)
        .map(|k| lab.read(&format!("out.{k:03}.xml")))
        .map(|text| (number(&text, "armature=\"") - 0.02, number(&text, "damping=\"") - 0.21))
        .collect();
    let sum = |of: &dyn Fn(&(f64, f64)) -> f64| values.iter().map(of).sum::<f64>();
    let correlation = sum(&|(a, b)| a * b) / (sum(&|(a, _)| a * a) * sum(&|(_, b)| b * b)).sqrt();
    assert!(correlation < -0.8, "{correlation}");
    assert!(lab.read("out.007.effects.json").contains("command_delay"));
    assert_ne!(lab.read("out.007.effects.json"), lab.read("out.008.effects.json"));
    // Another seed draws others, the same one the same.
    let first = lab.read("out.000.xml");
    lab.ok("export fitted.toml arm.xml --to mujoco -o out.xml --randomize fit.json --draws 1 --seed 1");
    assert_ne!(lab.read("out.000.xml"), first);
    lab.ok("export fitted.toml arm.xml --to mujoco -o out.xml --randomize fit.json --draws 1 --seed 0");
    assert_eq!(lab.read("out.000.xml"), first);
}

#[test]
fn what_is_no_fit_of_the_model_is_refused() {
    let lab = lab();
    lab.write("fit.json", FIT);
    lab.write("other.json", &FIT.replace("armature.inertia@yaw", "mass@tail"));
    lab.write("old.json", r#"{ "ok": true }"#);
    lab.write("no.json", "fitted");
    let complaints: Vec<String> = [
        "--to isaac-lab -o out.py --randomize other.json",
        "--to isaac-lab -o out.py --randomize old.json",
        "--to isaac-lab -o out.py --randomize no.json",
        "--to isaac-lab -o out.py --randomize missing.json",
        "--to ros2 -o out.yaml --randomize fit.json",
        "--to urdf -o out.urdf --draws 3",
        "--to urdf -o out.urdf --randomize fit.json --draws 0",
    ]
    .map(|arguments| lab.complaint(&format!("export fitted.toml {arguments}")))
    .into();
    insta::assert_snapshot!("export_randomize_refused", complaints.join("---\n"));
}
