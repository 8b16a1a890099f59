//! Boxes around the meshes that a URDF names: they are drawn, and say where a link ends. Meshes touch nothing.

mod bounds;
mod collada;
mod gltf;
mod obj;
mod search;
mod stl;

use bounds::Bounds;
use btr_core::limits::{LARGEST_MESH, MOST_MESHES};
use btr_physics::robot::Robot;
use btr_physics::robot::urdf::Mesh;
use search::MeshSearch;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Gives a robot the boxes around the meshes of its URDF, a file at a path. `packages` are folders that the user names.
/// Returns what is not known, in words.
pub(crate) fn enclose(robot: &mut Robot, meshes: &[Mesh], urdf: (&Path, &str), packages: &[PathBuf]) -> Vec<String> {
    let search = MeshSearch::new(urdf.0, packages);
    let mut known: BTreeMap<&str, Option<Bounds>> = BTreeMap::new();
    let mut findings = Vec::new();
    let lines = lines_of(urdf.1);
    for mesh in meshes.iter().take(MOST_MESHES) {
        let bounds = known.entry(&mesh.file).or_insert_with(|| {
            let place = lines.get(mesh.file.as_str()).map_or(String::new(), |line| format!(":{line}"));
            let told = |why| {
                findings.push(format!(
                    "{}{place}: link `{}`: the mesh `{}` {why}",
                    urdf.0.display(),
                    mesh.link,
                    mesh.file
                ));
            };
            read(&search, &mesh.file).map_err(told).ok()
        });
        if let Some(Bounds { low, high }) = bounds {
            mesh.enclose(robot, *low, *high);
        }
    }
    if meshes.len() > MOST_MESHES {
        findings.push(format!("{}: {} meshes; {MOST_MESHES} are read", urdf.0.display(), meshes.len()));
    }
    findings
}

/// The box of a mesh in its own units, or what is the matter with it.
fn read(search: &MeshSearch, name: &str) -> Result<Bounds, String> {
    let path = search.find(name)?;
    let ending = path.extension().unwrap_or_default().to_string_lossy().to_lowercase();
    let bytes = || btr_io::read_bytes(&path, LARGEST_MESH).map_err(|error| error.to_string());
    let bounds = match of(&ending) {
        Some(read) => bytes().and_then(|bytes| read(&bytes)),
        None => Err(format!("meshes of kind .{ending} are not read, but .stl, .obj, .dae, .gltf and .glb")),
    };
    bounds.map_err(|why| format!("({}): {why}; its extents are not known", path.display()))
}

type Reader = fn(&[u8]) -> Result<Bounds, String>;

/// The reader of files with this ending.
fn of(ending: &str) -> Option<Reader> {
    match ending {
        "stl" => Some(stl::bounds),
        "obj" => Some(obj::bounds),
        "dae" => Some(collada::bounds),
        "gltf" | "glb" => Some(gltf::bounds),
        _ => None,
    }
}

/// Reads a mesh of a kind (`stl`, `obj`, `dae`, `gltf`, `glb`).
///
/// # Errors
/// What is the matter with it; an unknown kind.
pub fn check(kind: &str, bytes: &[u8]) -> Result<(), String> {
    of(kind).ok_or("an unknown kind of mesh")?(bytes).map(drop)
}

/// The first line on which a URDF names each mesh.
fn lines_of(urdf: &str) -> BTreeMap<&str, usize> {
    let mut lines = BTreeMap::new();
    for (index, line) in urdf.lines().enumerate() {
        for named in line.split("filename").skip(1) {
            if let Some(name) = named.split(['"', '\'']).nth(1) {
                lines.entry(name).or_insert(index + 1);
            }
        }
    }
    lines
}
