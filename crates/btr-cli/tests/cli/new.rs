//! `btr new`: model files to start from.

use crate::lab::{Lab, robots, text};

/// A lab with the desk arm's URDF and a log of it, whose columns are renamed and whose numbers are changed.
fn lab(rename: &[(&str, &str)], change: impl Fn(usize, f64) -> f64) -> Lab {
    let lab = Lab::new();
    std::fs::copy(robots().join("arm.urdf"), lab.path("arm.urdf")).unwrap();
    lab.write("full.csv", &std::fs::read_to_string(robots().join("arm/learn_1.csv")).unwrap());
    lab.edit("full.csv", "log.csv", |row, cells| {
        for (column, cell) in cells.iter_mut().enumerate() {
            match row {
                0 => *cell = rename.iter().fold(cell.clone(), |name, (ours, theirs)| name.replace(ours, theirs)),
                _ => *cell = change(column, cell.parse().unwrap()).to_string(),
            }
        }
        row < 200
    });
    lab
}

#[test]
fn a_urdf_becomes_a_model_file() {
    let lab = lab(&[], |_, x| x);
    let told = lab.ok("new arm.urdf -o arm.toml");
    insta::assert_snapshot!("new_urdf", format!("{told}\n{}", lab.read("arm.toml")));
    std::fs::create_dir(lab.path("models")).unwrap();
    lab.ok("new arm.urdf log.csv -q -o models/arm.toml");
    assert!(lab.read("models/arm.toml").contains("urdf = \"../arm.urdf\""));
    lab.ok("check models/arm.toml log.csv");
}

#[test]
fn what_a_urdf_states_counts() {
    let lab = Lab::new();
    let inertial = "<inertial><mass value=\"2\"/><origin xyz=\"0 0 0.3\"/>\
                    <inertia ixx=\"0.1\" iyy=\"0.1\" izz=\"0.1\" ixy=\"0\" ixz=\"0\" iyz=\"0\"/></inertial>";
    let urdf = format!(
        "<robot name=\"lift\"><link name=\"world\"/><link name=\"bob\">{inertial}\
         <collision><geometry><mesh filename=\"package://gone/bob.stl\"/></geometry></collision></link>\
         <joint name=\"hinge\" type=\"revolute\"><parent link=\"world\"/><child link=\"bob\"/><axis xyz=\"0 1 0\"/>\
         <limit lower=\"-1\" upper=\"1\" effort=\"7\" velocity=\"3\"/><dynamics damping=\"0.4\" friction=\"0.3\"/>\
         </joint></robot>"
    );
    lab.write("lift.urdf", &urdf);
    let told = lab.ok("new lift.urdf -o lift.toml");
    let model = lab.read("lift.toml");
    for line in [
        "max_torque = 7.0",
        "\"damping@hinge\" = { bounds = [0.0, 1.2], value = 0.4 }",
        "\"friction@hinge\" = { bounds = [0.0, 0.9], value = 0.3 }",
        "# not represented: link `bob`: contacts of the mesh `package://gone/bob.stl`; only primitives have contacts",
        "# warning: lift.urdf:1: link `bob`: the mesh `package://gone/bob.stl` is not found: name the folder with the \
         package `gone` in package_paths of [robot]",
        "package_paths = []",
        "base = \"fixed\"\n",
    ] {
        assert!(model.contains(line), "{line} is not in\n{model}");
    }
    assert!(told.contains("not represented: link `bob`"), "{told}");
    assert!(told.contains("help: --package-path DIR names a folder with packages"), "{told}");
}

#[test]
fn what_logs_lack_is_told_of_each() {
    let lab = lab(&[], |_, x| x);
    let part = |to: &str, gone: &[&str]| {
        let names: Vec<String> = lab.read("log.csv").lines().next().unwrap().split(',').map(str::to_owned).collect();
        lab.edit("log.csv", to, |_, cells| {
            let mut kept = names.iter().map(|name| !gone.contains(&name.as_str()));
            cells.retain(|_| kept.next().unwrap());
            true
        });
    };
    part("no_elbow.csv", &["q_elbow", "cmd_elbow"]);
    part("no_yaw.csv", &["q_yaw"]);
    let told = lab.ok("new arm.urdf no_elbow.csv log.csv no_yaw.csv -o arm.toml");
    assert!(told.contains("warning: no_elbow.csv lacks the columns cmd_elbow, q_elbow\n"), "{told}");
    assert!(told.contains("warning: no_yaw.csv lacks the columns q_yaw\n"), "{told}");
    assert!(!told.contains("warning: log.csv") && !told.contains("has columns of"), "{told}");
    // What the first log lacks is found in the others: in degrees, as all of their positions.
    lab.edit("log.csv", "degrees.csv", |row, cells| {
        for cell in cells.iter_mut().skip(1).filter(|_| row > 0) {
            *cell = cell.parse::<f64>().unwrap().to_degrees().to_string();
        }
        cells.iter_mut().filter(|_| row == 0).for_each(|name| *name = name.replace("q_", "position "));
        true
    });
    lab.edit("degrees.csv", "first.csv", |_, cells| {
        cells.truncate(cells.len() - 1);
        true
    });
    let told = lab.ok("new arm.urdf first.csv degrees.csv -o both.toml");
    assert!(told.contains("warning: first.csv lacks the columns position elbow"), "{told}");
    assert!(lab.read("both.toml").contains("q_elbow = { column = \"position elbow\", factor = 0.0174532"));
    lab.write("other.csv", "t,a\n0,1\n1,2\n");
    let told = lab.complaint("new arm.urdf log.csv other.csv -o other.toml");
    assert!(told.starts_with("error: other.csv: none of its columns (t, a) is one of the joints"), "{told}");
}

#[test]
fn foreign_columns_in_degrees_and_milliseconds_are_matched() {
    let lab = lab(&[("cmd_", "goal position "), ("q_", "present position ")], |column, x| {
        if column == 0 { 1e3 * x } else { x.to_degrees() }
    });
    lab.write("log.csv", &lab.read("log.csv").replacen("t,", "timestamp,", 1));
    lab.edit("log.csv", "log.csv", |row, cells| {
        cells.insert(1, if row == 0 { "elbow temperature".to_owned() } else { "40".to_owned() });
        true
    });
    let told = lab.ok("new arm.urdf log.csv -o arm.toml");
    let model = lab.read("arm.toml");
    let channels = &model[model.find("[channels]").unwrap()..model.find("[parameters]").unwrap()];
    insta::assert_snapshot!("new_foreign_columns", format!("{told}\n{channels}"));
    // With these, the log is read as the one that it was made from.
    let read = lab.json("check arm.toml log.csv");
    lab.ok("new arm.urdf full.csv -q -o full.toml");
    lab.edit("full.csv", "part.csv", |row, _| row < 200);
    let same = lab.json("check full.toml part.csv");
    let lags = |document: &serde_json::Value| {
        let joints = document["logs"][0]["joints"].as_array().unwrap();
        joints.iter().map(|joint| (joint["command_lag"]["lag_s"].as_f64().unwrap() * 1e4).round()).collect::<Vec<_>>()
    };
    assert_eq!(lags(&read), lags(&same));
}

#[test]
fn numbered_columns_are_taken_in_the_order_of_the_joints() {
    let lab = lab(&[("yaw", "0"), ("shoulder", "1"), ("elbow", "2"), ("cmd_", "target_")], |_, x| x);
    let told = lab.ok("new arm.urdf log.csv -o arm.toml");
    assert!(told.contains("target_0 = yaw, target_1 = shoulder, target_2 = elbow"), "{told}");
    let model = lab.read("arm.toml");
    assert!(model.contains("cmd_elbow = \"target_2\"") && model.contains("q_elbow = \"q_2\""), "{model}");
}

#[test]
fn a_clock_of_any_name_is_the_column_that_only_grows() {
    let lab = lab(&[("t", "Zaehler"), ("cmd_", "Soll "), ("q_", "Ist ")], |_, x| x);
    let told = lab.ok("new arm.urdf log.csv -o arm.toml");
    assert!(told.contains("guess: Zaehler is the clock: no other column only grows"), "{told}");
    let model = lab.read("arm.toml");
    assert!(model.contains("time = \"Zaehler\"") && model.contains("cmd_elbow = \"Soll elbow\""), "{model}");
    lab.ok("check arm.toml log.csv");
}

#[test]
fn a_joint_without_a_command_is_told() {
    let lab = lab(&[("cmd_elbow", "note")], |_, x| x);
    let output = lab.run("new arm.urdf log.csv -o arm.toml");
    let told = text(&output.stdout) + &text(&output.stderr);
    assert!(told.contains("no column has commands of elbow"), "{told}");
    let told = lab.complaint("new arm.urdf log.csv -o other.toml --set robot.base=floating");
    assert!(told.contains("`btr new` does nothing with --set"), "{told}");
}

#[test]
fn velocities_have_the_unit_in_which_they_are_slopes() {
    let lab = lab(&[], |_, x| x);
    let mut before: Vec<f64> = Vec::new();
    lab.edit("log.csv", "slopes.csv", |row, cells| {
        let names = ["yaw", "shoulder", "elbow"];
        let now: Vec<f64> = cells[4..].iter().map(|cell| cell.parse().unwrap_or(0.0)).collect();
        let further = (0..3).map(|joint| match row {
            0 => format!("{} speed", names[joint]),
            1 => "0".to_owned(),
            _ => ((now[joint] - before[joint]) / 0.01).to_degrees().to_string(),
        });
        cells.extend(further.collect::<Vec<_>>());
        before = now;
        true
    });
    let told = lab.ok("new arm.urdf slopes.csv -o arm.toml");
    assert!(told.contains("guess: velocities are in degrees per second, by the positions' slopes"), "{told}");
    assert!(lab.read("arm.toml").contains("dq_elbow = { column = \"elbow speed\", factor = 0.0174532"));
}

#[test]
fn torques_without_commands_mean_a_prescribed_motion() {
    let lab = lab(&[("cmd_", "effort_")], |_, x| x);
    let told = lab.ok("new arm.urdf log.csv -o arm.toml");
    assert!(told.contains("the log has torques and no commands"), "{told}");
    assert!(lab.read("arm.toml").contains("elbow = { kind = \"prescribed\" }"));
}

#[test]
fn nothing_is_overwritten_unasked() {
    let lab = lab(&[], |_, x| x);
    lab.write("kept.toml", "mine");
    let told = [
        lab.complaint("new arm.urdf -o kept.toml"),
        lab.complaint("new arm.urdf -o arm.urdf"),
        lab.complaint("new gone.urdf -o new.toml"),
        lab.complaint("new log.csv -o new.toml"),
    ];
    insta::assert_snapshot!("new_refused", told.join("\n"));
    assert_eq!(lab.read("kept.toml"), "mine");
    lab.ok("new arm.urdf -o kept.toml --overwrite");
    assert!(lab.read("kept.toml").contains("arm.urdf"));
}

#[test]
fn other_verbs_say_how_to_make_a_model_of_a_robots_file() {
    let lab = lab(&[], |_, x| x);
    lab.write("scene.xml", "<mujoco/>");
    lab.write("arm.xacro", "<robot xmlns:xacro=\"http://www.ros.org/wiki/xacro\"/>");
    lab.write("other.csv", "t,a\n0,1\n1,2\n");
    let told = [
        lab.complaint("check arm.urdf log.csv"),
        lab.complaint("compare scene.xml log.csv"),
        lab.complaint("diagnose arm.xacro log.csv"),
        lab.complaint("simulate arm.urdf -o out.csv"),
        lab.complaint("fit log.csv log.csv"),
        lab.complaint("new arm.urdf other.csv -o other.toml"),
    ];
    insta::assert_snapshot!("new_mentioned", told.join("\n"));
}

#[test]
fn a_mujoco_model_without_python_says_what_to_install() {
    let lab = Lab::new();
    lab.write("scene.xml", "<mujoco/>");
    let output = lab.command("new scene.xml -o scene.toml").env("BTR_PYTHON", "gone-python").output().unwrap();
    let told = text(&output.stderr);
    assert_eq!(output.status.code(), Some(2));
    assert!(told.contains("is read by Python, with btr and mujoco in it: gone-python"), "{told}");
    assert!(told.contains("pip install 'btr[mujoco]'"), "{told}");
    assert!(!lab.exists("scene.toml"));
}
