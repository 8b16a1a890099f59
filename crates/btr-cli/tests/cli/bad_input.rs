//! Mistakes people make: each is refused at its line, with what to do about it. The words are snapshots.

use crate::lab::{Lab, text};

/// What `btr coevolve` says about the small experiment with one change.
fn with(before: &str, after: &str) -> String {
    Lab::with(&[(before, after)]).complaint("coevolve small.toml --out run --dry-run")
}

/// The complaints about several changes of the same line, one below the other.
fn all(before: &str, afters: &[&str]) -> String {
    afters.iter().map(|after| format!("{after}\n{}", with(before, after))).collect::<Vec<_>>().join("\n")
}

const MASS: &str = "\"mass@bob\" = { relative = [0.5, 1.5] }";
const REALITY: &str =
    "kind = \"twin\"\nparameters = { \"mass@bob\" = 1.3, \"viscous_friction.coefficient@hinge\" = 0.3 }";
const DISTANCE: &str = "distance = { name = \"rmse\", channels = [\"q_*\"] }";
const CONTROLLERS: &str = "controllers = { generations = 2, search = { algorithm = \"ga\", population = 6 } }";

#[test]
fn unknown_keys() {
    insta::assert_snapshot!("unknown_section", with("[simulation]", "[simulatoin]"));
    insta::assert_snapshot!("unknown_key", all("control_s = 0.01", &["contol_s = 0.01", "zebra = 1"]));
    insta::assert_snapshot!("unknown_key_of_a_motor", with("kp = 10.0", "kpp = 10.0"));
    insta::assert_snapshot!("unknown_key_of_reality", with("kind = \"twin\"", "kind = \"twin\"\nspred = 0.5"));
    insta::assert_snapshot!(
        "unknown_key_of_a_search",
        with("population = 6 } }\nsimulators", "populaton = 6 } }\nsimulators")
    );
}

#[test]
fn wrong_types_and_syntax() {
    insta::assert_snapshot!("wrong_type", all("duration_s = 0.5", &["duration_s = \"long\"", "duration_s = 0.5.5"]));
    insta::assert_snapshot!("wrong_type_in_a_table", with("kp = 10.0", "kp = \"stiff\""));
    insta::assert_snapshot!("wrong_word", with("kind = \"twin\"", "kind = \"tiwn\""));
    insta::assert_snapshot!("missing_key", with("name = \"small\"\n", ""));
    insta::assert_snapshot!("missing_section", with(&format!("[reality]\n{REALITY}\n"), ""));
}

#[test]
fn numbers_that_make_no_sense() {
    let wrong = ["control_s = 0.0", "control_s = -0.01", "control_s = nan"];
    insta::assert_snapshot!("time_step", all("control_s = 0.01", &wrong));
    insta::assert_snapshot!("negative_gain", all("kp = 10.0", &["kp = -10.0", "kp = nan"]));
    insta::assert_snapshot!("steps", with("steps_per_control = 2", "steps_per_control = 0"));
    insta::assert_snapshot!(
        "plan_numbers",
        [
            with("iterations = 2", "iterations = 0"),
            with("generations = 8", "generations = 0"),
            with("transfer = { count = 2 }", "transfer = { share = -0.5 }"),
            with("transfer = { count = 2 }", "disengagement = { patience = 0 }"),
            with("population = 6 } }\nsimulators", "population = 6, mutation = 1.5 } }\nsimulators"),
        ]
        .join("\n")
    );
}

#[test]
fn least_squares_need_a_sum_of_squares() {
    let changes = [(DISTANCE, "distance = \"spectrum\""), ("simulators = { ", "simulators = { refine = 2, ")];
    insta::assert_snapshot!(
        "refine_without_squares",
        Lab::with(&changes).complaint("coevolve small.toml --out run --dry-run")
    );
}

#[test]
fn maps_that_cannot_be_made() {
    let map = |map: &str| with("iterations = 2\n", &format!("iterations = 2\nmethod = \"quality_diversity\"\n{map}\n"));
    let told = [
        "",
        "map = {}",
        "map = { descriptors = { enrgy = [0.0, 1.0] } }",
        "map = { descriptors = { speed = [0.0, 1.0] } }",
        "map = { descriptors = { energy = [1.0, 1.0] } }",
        "map = { descriptors = { energy = [1.0] } }",
        "map = { cells = 0, descriptors = { energy = [0.0, 1.0] } }",
        "map = { enough = 1.5, descriptors = { energy = [0.0, 1.0] } }",
    ];
    insta::assert_snapshot!("map", told.map(map).join("\n"));
    let whitened = (DISTANCE, "distance = \"whitened\"");
    let both = "method = \"quality_diversity\"\nposterior = {}\nmap = { descriptors = { energy = [0.0, 1.0] } }\n";
    let lab = Lab::with(&[whitened, ("iterations = 2\n", &format!("iterations = 2\n{both}"))]);
    insta::assert_snapshot!("map_and_posterior", lab.complaint("coevolve small.toml --out run --dry-run"));
}

#[test]
fn bounds() {
    let wrong = [
        "\"mass@bob\" = { bounds = [2.0, 1.0] }",
        "\"mass@bob\" = { bounds = [1.0, 1.0] }",
        "\"mass@bob\" = { bounds = [nan, 1.0] }",
        "\"mass@bob\" = { bounds = [0.5, inf] }",
        "\"mass@bob\" = { bounds = [0.0, 2.0], scale = \"log\" }",
        "\"mass@bob\" = { bounds = [2.0, 3.0] }",
        "\"mass@bob\" = { bounds = [0.5, 1.5], relative = [0.5, 1.5] }",
        "\"mass@bob\" = { bounds = [0.5] }",
        "\"mass@bob\" = {}",
    ];
    insta::assert_snapshot!("bounds", all(MASS, &wrong));
}

#[test]
fn names_of_parameters_and_places() {
    let wrong = [
        "\"mas@bob\" = { bounds = [0.5, 1.5] }",
        "\"mass@bop\" = { bounds = [0.5, 1.5] }",
        "\"viscous_friction.coeficient@hinge\" = { bounds = [0.0, 1.0] }",
        "\"coulomb_friction.torque@hing\" = { bounds = [0.0, 1.0] }",
        "\"kt@hinge\" = { bounds = [0.0, 1.0] }",
    ];
    insta::assert_snapshot!("parameters", all(MASS, &wrong));
    insta::assert_snapshot!("actuator", with("[actuators.hinge]", "[actuators.hing]"));
    insta::assert_snapshot!("robot", with("builtin = \"pendulum\"", "builtin = \"pendulun\""));
    insta::assert_snapshot!("no_robot", with("builtin = \"pendulum\"\n", ""));
    insta::assert_snapshot!("urdf", with("builtin = \"pendulum\"", "urdf = \"arm.urdf\""));
}

#[test]
fn effects() {
    let placed = |effect: &str| format!("[[effects]]\n{effect}\n\n[drive]");
    let wrong = [
        "effect = \"coulomb_fiction\"",
        "effect = \"coulomb_friction\"\ntorqe = 0.1",
        "effect = \"coulomb_friction\"\nsite = \"hing\"\ntorque = 0.1",
        "effect = \"coulomb_friction\"\ntorque = \"much\"",
        "effect = \"coulomb_friction\"\ntorque = nan",
        "effect = \"payload\"\nmass = -3.0",
        "effect = \"cogging\"\namplitude = 0.1\norder = 0.0",
        "effect = \"armature\"\nlaw = \"q\"",
        "torque = 0.1",
    ];
    let wrong: Vec<String> = wrong.iter().map(|effect| placed(effect)).collect();
    insta::assert_snapshot!("effects", all("[drive]", &wrong.iter().map(String::as_str).collect::<Vec<_>>()));
    let formulas = [
        "on = \"torque\"",
        "law = \"-a*q\"",
        "on = \"speed\"\nlaw = \"-a*q\"",
        "on = \"torque\"\nlaw = \"-a*q\"",
        "on = \"torque\"\nlaw = \"-a*(q\"\na = 0.1",
        "on = \"torque\"\nlaw = \"-a*q\"\na = 0.1\nb = 0.2",
        "on = \"torque\"\nlaw = \"-dq*q\"\ndq = 0.1",
        "on = \"torque\"\nlaw = \"-a*q\"\na = nan",
        "on = \"torque\"\nlaw = \"-a*q\"\na = 0.1\nsite = \"hing\"",
        "on = \"torque\"\nlaw = \"-a*q_parent\"\na = 0.1",
        "on = \"reading\"\nlaw = \"q + a*q_child\"\na = 0.1",
        "on = \"torque\"\nlaw = \"-q_child*q\"\nq_child = 0.1",
    ];
    let formulas: Vec<String> = formulas.iter().map(|law| placed(&format!("effect = \"formula\"\n{law}"))).collect();
    insta::assert_snapshot!("formulas", all("[drive]", &formulas.iter().map(String::as_str).collect::<Vec<_>>()));
    let coupled = "[[effects]]\neffect = \"formula\"\non = \"command\"\nlaw = \"cmd + 0.1*q_parent\"\n\n[drive]";
    let ant = [
        ("builtin = \"pendulum\"\nlength_m = 0.5", "builtin = \"ant\""),
        ("[actuators.hinge]", "[actuators.\"*\"]"),
        (MASS, ""),
        ("\"viscous_friction.coefficient@hinge\" = { bounds = [0.0, 0.5] }", ""),
        (REALITY, "kind = \"twin\""),
        ("[drive]", coupled),
    ];
    insta::assert_snapshot!("formula_of_a_neighbour", Lab::with(&ant).complaint("simulate small.toml -o walk.csv"));
    insta::assert_snapshot!("formula_in_doubt", with(MASS, "\"formula.a@hinge\" = { bounds = [0.0, 1.0] }"));
    let hidden = "kind = \"twin\"\neffects = [{ effect = \"payloud\" }]";
    insta::assert_snapshot!("hidden_effect", with("kind = \"twin\"", hidden));
    insta::assert_snapshot!("effects_verb", Lab::new().complaint("effects armatur"));
    insta::assert_snapshot!("effects_by_a_word", Lab::new().complaint("effects frction"));
}

#[test]
fn drives() {
    let wrong = [
        "kind = \"sin\"",
        "kind = \"sine\"\nset = { \"amplitud@hinge\" = 0.1 }",
        "kind = \"replay\"",
        "kind = \"replay\"\nlog = \"no.csv\"",
    ];
    insta::assert_snapshot!("drives", all("kind = \"sine\"", &wrong));
    let wrong =
        ["search = \"al\"", "search = [\"phas@hinge\"]", "search = { \"phase@hinge\" = [1.0, -1.0] }", "search = 3"];
    insta::assert_snapshot!("searched", all("search = \"all\"", &wrong));
    insta::assert_snapshot!("omega", with("omega_rad_s = 8.0\n", ""));
    let nao =
        [("builtin = \"pendulum\"\nlength_m = 0.5", "builtin = \"ant\""), ("[actuators.hinge]", "[actuators.\"*\"]")];
    let lab = Lab::with(&[
        nao[0],
        nao[1],
        (MASS, ""),
        ("\"viscous_friction.coefficient@hinge\" = { bounds = [0.0, 0.5] }", ""),
        ("kind = \"sine\"", "kind = \"nao_walk\""),
        (REALITY, "kind = \"twin\""),
    ]);
    insta::assert_snapshot!("walk_of_an_ant", lab.complaint("simulate small.toml -o walk.csv"));
}

#[test]
fn policies() {
    let wrong = [
        "kind = \"sine\"\nhidden = 2",
        "kind = \"policy\"\naround = \"sin\"",
        "kind = \"policy\"\naround = \"policy\"",
        "kind = \"policy\"\nsensors = [\"giro\"]",
        "kind = \"policy\"\njoints = \"hing\"",
        "kind = \"policy\"\nhidden = -1",
    ];
    insta::assert_snapshot!("policies", all("kind = \"sine\"", &wrong));
    let policy = ("kind = \"sine\"", "kind = \"policy\"\nsensors = [\"clock\"]");
    let timeless = Lab::with(&[policy, ("omega_rad_s = 8.0\n", "")]);
    insta::assert_snapshot!("policy_without_a_clock", timeless.complaint("coevolve small.toml --out run --dry-run"));
    let by_hand = Lab::with(&[policy, (REALITY, "kind = \"manual\"")]);
    insta::assert_snapshot!("policy_by_hand", by_hand.complaint("coevolve small.toml --out run --dry-run"));
}

#[test]
fn fitness_and_distance_and_search() {
    let wrong = ["enrgy = 1.0", "ball_distance = 1.0", "speed = 1.0"];
    insta::assert_snapshot!("fitness", all("energy = 1.0", &wrong));
    let wrong = [
        "distance = \"rsme\"",
        "distance = { name = \"rmse\", chanels = [\"q_*\"] }",
        "distance = { name = \"rmse\", channels = [\"q_hing\"] }",
    ];
    insta::assert_snapshot!("distance", all(DISTANCE, &wrong));
    let wrong = [
        "controllers = { generations = 2, search = { algorithm = \"cmaes\" } }",
        "controllers = { generations = 2 }",
        "",
    ];
    insta::assert_snapshot!("search", all(CONTROLLERS, &wrong));
}

#[test]
fn realities() {
    let wrong = [
        "kind = \"twin\"\nparameters = { \"mass@bob\" = 9.0 }",
        "kind = \"twin\"\nparameters = { \"mass@bo\" = 1.0 }",
        "kind = \"twin\"\nparameters = \"randm\"",
        "kind = \"command\"\nrun = []\ntimeout_s = 1.0",
        "kind = \"command\"\nrun = [\"./robot\"]",
        "kind = \"command\"\nrun = [\"./robot\"]\ntimeout_s = inf",
        "kind = \"command\"\nrun = [\"./robot\"]\ntimeout_s = 9.0\nlog = \"bag\"",
        "kind = \"command\"\nrun = [\"./robot\"]\ntimeout_s = 9.0\nstop_s = 0.0",
        "kind = \"command\"\nrun = [\"./robot\"]\ntimeout_s = 9.0\nstop_signal = \"sigkill\"",
        "kind = \"logs\"",
        "kind = \"logs\"\nfiles = [\"a.csv\"]\nheld_out = [\"a.csv\"]",
        "kind = \"logs\"\nindex = \"index.csv\"",
        "kind = \"logs\"\nfiles = [\"no.csv\"]",
    ];
    insta::assert_snapshot!("realities", all(REALITY, &wrong));
}

/// What is said about a recorded log of these bytes.
fn log(name: &str, bytes: &[u8]) -> String {
    let reality = format!("kind = \"logs\"\nfiles = [\"{name}\"]");
    let lab = Lab::with(&[(REALITY, &reality), ("search = \"all\"", "")]);
    std::fs::write(lab.path(name), bytes).unwrap();
    lab.complaint("coevolve small.toml --out run --dry-run")
}

#[test]
fn logs() {
    let csv = [
        "",
        "t,cmd_hinge,q_hinge\n",
        "t,cmd_knee,q_knee\n0,0,0\n0.1,0,0\n",
        "t,cmd_hinge\n0,0\n0.1,0\n",
        "time,cmd_hinge,q_hinge\n0,0,0\n0,0,0\n",
        "t,cmd_hinge,q_hinge\n0,0,0\n1,zero,0\n",
        "t,cmd_hinge,q_hinge\n0,0,0,0\n",
        "when,cmd_hinge,q_hinge\n0,0,0\n",
        "t;cmd_hinge;q_hinge\n0,00;0;0\n0,01;1.234;0\n",
        "t,cmd_hinge,q_hinge\n0,0,0\n10,0,0\n20,0,0\n",
        "t,cmd_hinge,q_hinge\n0,0,0\n10000,0,0\n20000,0,0\n",
    ];
    let told: Vec<String> = csv.iter().map(|csv| format!("{csv}{}", log("log.csv", csv.as_bytes()))).collect();
    insta::assert_snapshot!("csv_logs", told.join("\n"));

    let lab = Lab::new();
    lab.ok("simulate small.toml -q -o whole.mcap");
    let whole = std::fs::read(lab.path("whole.mcap")).unwrap();
    std::fs::write(lab.path("cut.mcap"), &whole[..whole.len() / 2]).unwrap();
    let told = lab.run("info cut.mcap --json");
    let said = text(&told.stdout) + &text(&told.stderr);
    assert!(said.contains("is truncated") || said.contains("damaged: before the first message"), "{said}");
    insta::assert_snapshot!(
        "mcap_logs",
        [log("log.mcap", &whole[..100]), log("log.mcap", b"not a recording"), log("log.bag", b"?"),].join("\n")
    );
    let searched = Lab::with(&[(REALITY, "kind = \"logs\"\nfiles = [\"whole.csv\"]")]);
    searched.ok("simulate small.toml -q -o whole.csv");
    insta::assert_snapshot!("logs_and_controllers", searched.complaint("coevolve small.toml --out run --dry-run"));
}

#[test]
fn columns_that_the_file_names_and_the_log_lacks() {
    let lab = Lab::new();
    lab.write("log.csv", "t,target,encoder\n0,0,0\n0.01,0,0\n0.02,0,0\n");
    let with = |channels: &str| {
        lab.write("mapped.toml", &format!("{}\n[channels.channels]\n{channels}", lab.read("small.toml")));
        lab.complaint("compare mapped.toml log.csv")
    };
    let told = [
        with("cmd_hinge = \"target\"\nq_hinge = \"encodre\""),
        with("cmd_hinge = \"goal\"\nq_hinge = \"encoder\""),
        with("\"cmd_{joint}\" = \"target_{joint}\"\nq_hinge = \"encoder\""),
    ];
    insta::assert_snapshot!("lacking_columns", told.join("\n"));
}

#[test]
fn robots_that_make_no_sense() {
    let lab = Lab::with(&[("builtin = \"pendulum\"\nlength_m = 0.5", "urdf = \"arm.urdf\"")]);
    let with = |urdf: &str| {
        lab.write("arm.urdf", urdf);
        lab.complaint("simulate small.toml -o out.csv")
    };
    let arm = |kind: &str, inertial: &str| {
        format!(
            "<robot name=\"arm\">\n<link name=\"base\"/>\n<link name=\"bob\">{inertial}</link>\n\
             <joint name=\"hinge\" type=\"{kind}\">\n<parent link=\"base\"/><child link=\"bob\"/></joint></robot>"
        )
    };
    let told = [with("<robot>"), with(&arm("hinge", "")), with(&arm("floating", "")), with(&arm("continuous", ""))];
    insta::assert_snapshot!("urdf_errors", told.join("\n"));
    let body = "<inertial><mass value=\"1\"/><inertia ixx=\"1\" iyy=\"1\" izz=\"1\" ixy=\"0\" ixz=\"0\" iyz=\"0\"/></inertial>";
    lab.write("small.toml", &lab.read("small.toml").replace("mass@bob", "mass@base"));
    insta::assert_snapshot!("massless_link", with(&arm("continuous", body)));
}

#[test]
fn indices() {
    let with_index = |table: &str, conditions: &str| {
        let reality = format!("kind = \"logs\"\nindex = \"index.csv\"\n{conditions}");
        let lab = Lab::with(&[(REALITY, &reality), ("search = \"all\"", "")]);
        lab.write("index.csv", table);
        lab.complaint("coevolve small.toml --out run --dry-run")
    };
    insta::assert_snapshot!(
        "indices",
        [
            with_index("path,kp\na.csv,1\n", "learn = { kp = 1 }"),
            with_index("file,kp\na.csv,1\n", "learn = { kq = 1 }"),
            with_index("file,kp\na.csv,1\n", "learn = { kp = 2 }"),
            with_index("file,kp\na.csv,1\n", "learn = { kp = 1 }\njudge = { kp = 1 }"),
        ]
        .join("\n")
    );
}

#[test]
fn files_that_are_not_there() {
    let lab = Lab::new();
    insta::assert_snapshot!(
        "missing_files",
        [
            lab.complaint("coevolve nothing.toml"),
            lab.complaint("simulate small.toml --log nothing.csv -o out.csv"),
            lab.complaint("simulate small.toml --drive nothing.toml -o out.csv"),
            lab.complaint("info nothing.mcap"),
            lab.complaint("convert nothing.csv out.mcap"),
            lab.complaint("simulate small.toml -o out.txt"),
            lab.complaint("simulate small.toml -o no/such/folder/out.csv"),
            lab.complaint("compare nothing.tml nothing.csv"),
        ]
        .join("\n")
    );
}

#[test]
fn command_lines_that_make_no_sense() {
    let lab = Lab::new();
    let told = ["nosuch", "diagnose small.toml --held-out a.csv b.csv log.csv", "fit small.toml --held-out a.csv"]
        .map(|arguments| lab.complaint(arguments));
    insta::assert_snapshot!("command_lines", told.join("\n"));
}

#[test]
fn settings_on_the_command_line() {
    let lab = Lab::new();
    let told =
        ["simulation.duration_s", "simulation.duraton_s=1", "simulation..duration_s=1", "name.first=1", "seed=many"]
            .map(|setting| lab.complaint(&format!("coevolve small.toml --out run --set {setting}")));
    insta::assert_snapshot!("settings", told.join("\n"));
}

#[test]
fn a_model_that_blows_up_is_counted_and_told() {
    let lab = Lab::with(&[("duration_s = 0.5", "duration_s = 0.5\ngravity = -1e12")]);
    let told = lab.complaint("simulate small.toml -o out.csv");
    assert!(told.contains("the simulation diverged at t = ") && told.contains("help: "), "{told}");
    let output = lab.run("coevolve small.toml --out run --json");
    let stdout = text(&output.stdout);
    assert_eq!(output.status.code(), Some(1), "{stdout}{}", text(&output.stderr));
    let document: serde_json::Value = serde_json::from_str(&stdout).unwrap();
    assert_eq!(document["stop_reason"], "no_real_data");
    assert_eq!(document["failed_evaluations"], document["simulated_evaluations"]);
    assert!(document["failed_evaluations"].as_u64().unwrap() >= 12);
}
