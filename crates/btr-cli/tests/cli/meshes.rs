//! Meshes of URDF: where they are looked for, and what is made of their boxes.

use crate::lab::{Lab, text};

/// A pointer of 1 kg on a hinge, which is a box from -0.1 to 0.9 m along x in its mesh.
fn lab(mesh: &str) -> Lab {
    let lab = Lab::new();
    lab.write(
        "arm.urdf",
        &format!(
            "<robot name=\"arm\">\n<link name=\"world\"/>\n<link name=\"pointer\">\
             <inertial><mass value=\"1\"/><origin xyz=\"0.4 0 0\"/>\
             <inertia ixx=\"0.01\" iyy=\"0.01\" izz=\"0.01\" ixy=\"0\" ixz=\"0\" iyz=\"0\"/></inertial>\n\
             <collision><geometry>\n<mesh filename=\"{mesh}\" scale=\"0.1 0.1 0.1\"/></geometry></collision></link>\n\
             <joint name=\"hinge\" type=\"revolute\"><parent link=\"world\"/><child link=\"pointer\"/><axis xyz=\"0 1 0\"/>\
             <limit lower=\"-1\" upper=\"1\" effort=\"5\" velocity=\"3\"/></joint></robot>\n"
        ),
    );
    lab
}

/// The box from `-1 -2 -3` to `9 2 3` in each format.
const OBJ: &str = "# a box\nv -1 -2 -3\nv 9 2 3\nf 1 2 1\n";
const STL: &str =
    "solid box\nfacet normal 0 0 1\nouter loop\nvertex -1 -2 -3\nvertex 9 2 3\nvertex 0 0 0\nendloop\nendfacet\n";
const DAE: &str = "<COLLADA><asset><unit meter=\"0.01\"/></asset><library_geometries><geometry id=\"g\"><mesh>\
    <source id=\"s\"><float_array>-2 100 -3 2 -900 3</float_array></source>\
    <vertices id=\"v\"><input semantic=\"POSITION\" source=\"#s\"/></vertices></mesh></geometry></library_geometries>\
    <library_visual_scenes><visual_scene><node><scale>1 100 100</scale><matrix>0 -1 0 0 1 0 0 0 0 0 1 0 0 0 0 1</matrix>\
    <instance_geometry url=\"#g\"/></node></visual_scene></library_visual_scenes></COLLADA>";

/// Its y is up: the box is from `-1 -3 -2` to `9 3 2` there.
const GLTF: &str = r#"{"asset":{"version":"2.0"},"scenes":[{"nodes":[0]}],"nodes":[{"mesh":0,"translation":[4,0,0]}],
    "meshes":[{"primitives":[{"attributes":{"POSITION":0}}]}],"buffers":[{"uri":"gone.bin","byteLength":24}],
    "accessors":[{"componentType":5126,"count":2,"type":"VEC3","min":[-5,-3,-2],"max":[5,3,2]}]}"#;

fn binary_gltf() -> Vec<u8> {
    let length = GLTF.len() as u32;
    let numbers = [2, 20 + length, length].into_iter().flat_map(u32::to_le_bytes);
    b"glTF".iter().copied().chain(numbers).chain(*b"JSON").chain(GLTF.bytes()).collect()
}

fn binary_stl() -> Vec<u8> {
    let mut bytes = b"solid by its remark".to_vec();
    bytes.resize(80, b' ');
    bytes.extend(1_u32.to_le_bytes());
    [0.0, 0.0, 1.0, -1.0, -2.0, -3.0, 9.0, 2.0, 3.0, 0.0, 0.0, 0.0_f32]
        .iter()
        .for_each(|x| bytes.extend(x.to_le_bytes()));
    bytes.extend([0, 0]);
    bytes
}

/// The URDF for viewers in a recording of a model's simulation, with variables of the environment.
fn drawn(lab: &Lab, model: &str, variables: &[(&str, &str)]) -> String {
    let mut command =
        lab.command(&format!("simulate {model} --set simulation.duration_s=0.1 -q -o run.mcap --overwrite"));
    command.envs(variables.iter().map(|(name, folder)| (name, lab.path(folder))));
    let output = command.output().unwrap();
    assert!(output.status.success(), "{}", text(&output.stderr));
    let bytes = std::fs::read(lab.path("run.mcap")).unwrap();
    let mut messages = mcap::MessageStream::new(&bytes).unwrap().map(Result::unwrap);
    let description = messages.find(|message| message.channel.topic == "/robot_description").unwrap();
    String::from_utf8_lossy(&description.data).into_owned()
}

#[test]
fn meshes_of_all_formats_are_drawn_as_their_box() {
    let files: [(&str, Vec<u8>); 6] = [
        ("m.obj", OBJ.into()),
        ("m.stl", STL.into()),
        ("b.STL", binary_stl()),
        ("m.dae", DAE.into()),
        ("m.gltf", GLTF.into()),
        ("m.GLB", binary_gltf()),
    ];
    for (name, bytes) in files {
        let lab = lab(name);
        std::fs::write(lab.path(name), bytes).unwrap();
        let told = lab.ok("new arm.urdf -o arm.toml");
        assert!(!told.contains("warning"), "{name}: {told}");
        let urdf = drawn(&lab, "arm.toml", &[]);
        assert!(urdf.contains("<origin xyz=\"0.4 0 0\""), "{name}: {urdf}");
        assert!(urdf.contains("<box size=\"1 0.4 0.6"), "{name}: {urdf}");
        assert_eq!((urdf.matches("<visual>").count(), urdf.matches("<collision>").count()), (1, 0), "{name}: {urdf}");
        // A model that says nothing of packages is as it was.
        lab.write("old.toml", &lab.read("arm.toml").replace("package_paths = []", ""));
        assert!(!drawn(&lab, "old.toml", &[]).contains("<box"));
    }
}

#[test]
fn packages_are_looked_for_in_the_documented_order() {
    let lab = lab("package://shapes/meshes/m.obj");
    // A package by its description, around the URDF itself.
    lab.write("package.xml", "<package><name>shapes</name></package>");
    let place = |folder: &str, reach: f64| {
        std::fs::create_dir_all(lab.path(folder)).unwrap();
        lab.write(&format!("{folder}/m.obj"), &format!("v 0 0 0\nv {reach} 1 1\n"));
    };
    place("meshes", 10.0);
    let told = lab.ok("new arm.urdf -o unstated.toml");
    assert!(!told.contains("warning") && lab.read("unstated.toml").contains("package_paths = []"), "{told}");
    place("ament/share/shapes/meshes", 20.0);
    place("ros/shapes/meshes", 30.0);
    place("stated/shapes/meshes", 40.0);
    std::fs::create_dir(lab.path("models")).unwrap();
    lab.ok("new arm.urdf --package-path stated -q -o models/stated.toml");
    assert!(lab.read("models/stated.toml").contains("package_paths = [\"../stated\"]"));
    let (ros, ament) = (("ROS_PACKAGE_PATH", "ros"), ("AMENT_PREFIX_PATH", "ament"));
    for (model, variables, size) in [
        ("models/stated.toml", &[ros, ament][..], 4),
        ("unstated.toml", &[ros, ament][..], 3),
        ("unstated.toml", &[ament][..], 2),
        ("unstated.toml", &[][..], 1),
    ] {
        let urdf = drawn(&lab, model, variables);
        assert!(urdf.contains(&format!("<box size=\"{size} ")), "{model}: {urdf}");
    }
    let told = lab.complaint("new arm.urdf --package-path gone -o gone.toml");
    assert_eq!(told, "error: gone: there is no such folder\n");
}

#[test]
fn what_is_not_known_of_a_mesh_is_told_by_every_verb_that_would_use_it() {
    let lab = lab("package://shapes/m.stl");
    lab.ok("new arm.urdf -q -o arm.toml");
    let of = |name: &str, content: &str| {
        lab.write("shapes.urdf", &lab.read("arm.urdf").replace("package://shapes/m.stl", name));
        lab.write(name, content);
        let told = lab.ok("new shapes.urdf -o shapes.toml --overwrite");
        told.lines()
            .find(|line| line.starts_with("warning: "))
            .unwrap()
            .replace(&lab.path("").display().to_string(), "")
    };
    let told = [
        of("m.ply", "ply"),
        of("m.glb", "glTF"),
        of("m.gltf", "{}"),
        of("cut.stl", "no triangles"),
        of("none.obj", "# nothing\n"),
        of("nan.obj", "v nan 0 0\n"),
        of("words.dae", "<COLLADA>"),
        text(
            &lab.command("simulate arm.toml --set simulation.duration_s=0.1 -q -o run.csv --overwrite")
                .output()
                .unwrap()
                .stderr,
        ),
        text(
            &lab.command("simulate arm.toml --set simulation.duration_s=0.1 -o run.csv --overwrite")
                .output()
                .unwrap()
                .stderr,
        ),
    ];
    insta::assert_snapshot!("meshes_unknown", told.join("\n"));
    let told = text(&lab.command("check arm.toml run.csv").output().unwrap().stderr);
    assert!(
        told.contains("warning: arm.urdf:5: link `pointer`: the mesh `package://shapes/m.stl` is not found"),
        "{told}"
    );
}

#[test]
fn what_a_urdf_states_of_a_joint_acts_in_the_motion() {
    let lab = lab("m.obj");
    lab.write("m.obj", OBJ);
    let with = |dynamics: &str, name: &str| {
        lab.write("shapes.urdf", &lab.read("arm.urdf").replace("<axis", &format!("{dynamics}<axis")));
        lab.ok(&format!("new shapes.urdf -q -o {name}.toml"));
        std::fs::rename(lab.path("shapes.urdf"), lab.path(&format!("{name}.urdf"))).unwrap();
        lab.write(
            &format!("{name}.toml"),
            &lab.read(&format!("{name}.toml")).replace("shapes.urdf", &format!("{name}.urdf")),
        );
    };
    lab.write("step.csv", "t,cmd_hinge,q_hinge\n0,0.5,0\n0.5,0.5,0\n1,0.5,0\n");
    let motion = |model: &str, settings: &str| {
        lab.ok(&format!("simulate {model}.toml --log step.csv {settings} -q -o out.csv --overwrite"));
        let text = lab.read("out.csv");
        let column = |name: &str| {
            let at = text.lines().next().unwrap().split(',').position(|column| column == name).unwrap();
            text.lines().skip(1).map(|line| line.split(',').nth(at).unwrap().parse().unwrap()).collect::<Vec<f64>>()
        };
        [column("dq_hinge"), column("tau_hinge")]
    };
    let most = |values: &[f64]| values.iter().fold(0.0_f64, |most, x| most.max(x.abs()));
    with("", "bare");
    with("<dynamics damping=\"2\" friction=\"0\"/>", "damped");
    with("<dynamics damping=\"0\" friction=\"3\"/>", "rough");
    let stiff = "--set simulation.gravity=0.0 --set actuators.hinge.kp=200 --set actuators.hinge.kd=1";
    let [bare, damped, rough] = ["bare", "damped", "rough"].map(|model| motion(model, stiff));
    assert!(most(&damped[0]) < 0.9 * most(&bare[0]) && most(&rough[0]) < 0.9 * most(&bare[0]));
    // The servo asks for 100 N·m and has the URDF's effort; without that line it has what it asks for.
    assert!((most(&bare[1]) - 5.0).abs() < 1e-6, "{}", most(&bare[1]));
    let free = motion("bare", &format!("{stiff} --set actuators.hinge.max_torque=inf"));
    assert!(most(&free[1]) > 10.0, "{}", most(&free[1]));
    lab.ok("export bare.toml --to ros2 -q -o limits.yaml");
    let limits = lab.read("limits.yaml");
    assert!(limits.contains("max_velocity: 3.0") && limits.contains("max_effort: 5.0"), "{limits}");
    // No effort is no limit.
    lab.write("arm.urdf", &lab.read("arm.urdf").replace("effort=\"5\"", "effort=\"0\""));
    with("", "unlimited");
    assert!(!lab.read("unlimited.toml").contains("max_torque ="));
}
