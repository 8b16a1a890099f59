//! glTF 2.0 (`.gltf`, and `.glb` with the same JSON in a binary container): the meshes that its scene places.
//!
//! A file states the extents of each mesh's positions (`min` and `max`, which are mandatory), so no buffer is read: of
//! a mesh that its node turns, the box is that around its turned box. glTF has y up and URDF z. Meshes are turned as in
//! RViz (ros2/rviz#1482), Drake and Genesis, by 90° about x; viewers that rely on three.js or trimesh do not turn them.

use super::bounds::Bounds;
use nalgebra::{Matrix4, Point3, Quaternion, UnitQuaternion, Vector3};
use serde::Deserialize;
use std::collections::BTreeMap;

/// Nodes and meshes that a scene may place: nodes may be in each other.
const MOST_PLACED: usize = 1_000_000;
/// First bytes of a binary file, and the kind of its chunk with the JSON.
const MAGIC: &[u8] = b"glTF";
const JSON: &[u8] = b"JSON";
/// Bytes before the JSON of a binary file.
const HEAD: usize = 20;

/// What of a file is read.
#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct File {
    asset: Asset,
    #[serde(default)]
    scene: usize,
    #[serde(default)]
    scenes: Vec<Scene>,
    #[serde(default)]
    nodes: Vec<Node>,
    #[serde(default)]
    meshes: Vec<Mesh>,
    #[serde(default)]
    accessors: Vec<Accessor>,
}

#[derive(Deserialize)]
struct Asset {
    version: String,
}

#[derive(Deserialize)]
struct Scene {
    #[serde(default)]
    nodes: Vec<usize>,
}

#[derive(Deserialize)]
struct Node {
    #[serde(default)]
    children: Vec<usize>,
    mesh: Option<usize>,
    matrix: Option<[f64; 16]>,
    #[serde(default)]
    translation: [f64; 3],
    #[serde(default = "unturned")]
    rotation: [f64; 4],
    #[serde(default = "unscaled")]
    scale: [f64; 3],
}

fn unturned() -> [f64; 4] {
    [0.0, 0.0, 0.0, 1.0]
}

fn unscaled() -> [f64; 3] {
    [1.0; 3]
}

#[derive(Deserialize)]
struct Mesh {
    primitives: Vec<Primitive>,
}

#[derive(Deserialize)]
struct Primitive {
    attributes: BTreeMap<String, usize>,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct Accessor {
    component_type: u32,
    #[serde(default)]
    normalized: bool,
    min: Option<Vec<f64>>,
    max: Option<Vec<f64>>,
}

/// The box of a glTF file.
///
/// # Errors
/// A file that is no glTF 2.0 or cut off, or whose scene places nothing.
pub(super) fn bounds(bytes: &[u8]) -> Result<Bounds, String> {
    let json = if bytes.starts_with(MAGIC) { json_of(bytes)? } else { bytes };
    let file: File = serde_json::from_slice(json).map_err(|error| format!("it is no glTF 2.0: {error}"))?;
    if !file.asset.version.starts_with("2.") {
        return Err(format!("it is a glTF {}, not 2.0", file.asset.version));
    }
    let mut bounds = Bounds::none();
    file.place(&mut bounds)?;
    bounds.known()
}

/// The JSON of a binary file.
fn json_of(bytes: &[u8]) -> Result<&[u8], String> {
    let number = |at: usize| bytes.get(at..at + 4).map(|b| u32::from_le_bytes([b[0], b[1], b[2], b[3]]) as usize);
    let cut_off = || "it is a glTF that is cut off".to_owned();
    let (version, whole, length) = number(4)
        .zip(number(8))
        .zip(number(12))
        .map(|((version, whole), length)| (version, whole, length))
        .ok_or_else(cut_off)?;
    if version != 2 {
        return Err(format!("it is a binary glTF of version {version}, not 2"));
    }
    if whole > bytes.len() {
        return Err(cut_off());
    }
    if bytes.get(HEAD - 4..HEAD) != Some(JSON) {
        return Err("it is a binary glTF that does not begin with its JSON".to_owned());
    }
    length.checked_add(HEAD).and_then(|end| bytes.get(HEAD..end)).ok_or_else(cut_off)
}

impl File {
    /// Includes what the scene places.
    fn place(&self, bounds: &mut Bounds) -> Result<(), String> {
        // From y up to z up.
        let upright = Matrix4::from_axis_angle(&Vector3::x_axis(), std::f64::consts::FRAC_PI_2);
        let mut open: Vec<(usize, Matrix4<f64>)> = self.roots().into_iter().map(|node| (node, upright)).collect();
        let mut placed = 0;
        while let Some((node, around)) = open.pop() {
            let node = self.nodes.get(node).ok_or_else(|| lacks("node", node))?;
            let place = around * node.transform();
            let many = 1 + node.mesh.map_or(Ok(0), |mesh| self.mesh(mesh, &place, bounds))?;
            placed += many + node.children.len();
            if placed > MOST_PLACED {
                return Err(format!("its scene places more than {MOST_PLACED} nodes and meshes"));
            }
            open.extend(node.children.iter().map(|child| (*child, place)));
        }
        Ok(())
    }

    /// The nodes of the scene; without a scene, those that are in no other.
    fn roots(&self) -> Vec<usize> {
        if let Some(scene) = self.scenes.get(self.scene) {
            return scene.nodes.clone();
        }
        let mut is_root = vec![true; self.nodes.len()];
        for child in self.nodes.iter().flat_map(|node| &node.children) {
            is_root.get_mut(*child).into_iter().for_each(|root| *root = false);
        }
        (0..self.nodes.len()).filter(|node| is_root[*node]).collect()
    }

    /// Includes a mesh; returns of how many parts it is.
    fn mesh(&self, index: usize, place: &Matrix4<f64>, bounds: &mut Bounds) -> Result<usize, String> {
        let mesh = self.meshes.get(index).ok_or_else(|| lacks("mesh", index))?;
        for accessor in mesh.primitives.iter().filter_map(|part| part.attributes.get("POSITION").copied()) {
            let [low, high] = self.accessors.get(accessor).ok_or_else(|| lacks("accessor", accessor))?.extents()?;
            for corner in 0..8 {
                let end = |k: usize| if corner >> k & 1 == 0 { low[k] } else { high[k] };
                bounds.include(&place.transform_point(&Point3::new(end(0), end(1), end(2))))?;
            }
        }
        Ok(mesh.primitives.len())
    }
}

/// What is said of a file that names what it does not have.
fn lacks(what: &str, index: usize) -> String {
    format!("it names {what} {index}, which it does not have")
}

impl Node {
    fn transform(&self) -> Matrix4<f64> {
        if let Some(columns) = &self.matrix {
            return Matrix4::from_column_slice(columns);
        }
        let [x, y, z, w] = self.rotation;
        let turn = UnitQuaternion::try_new(Quaternion::new(w, x, y, z), f64::EPSILON).unwrap_or_default();
        let scale = Matrix4::new_nonuniform_scaling(&self.scale.into());
        Matrix4::new_translation(&self.translation.into()) * turn.to_homogeneous() * scale
    }
}

impl Accessor {
    /// Its least and largest values.
    fn extents(&self) -> Result<[[f64; 3]; 2], String> {
        // Quantised positions may stand for fractions.
        let whole = match (self.normalized, self.component_type) {
            (true, 5120) => f64::from(i8::MAX),
            (true, 5121) => f64::from(u8::MAX),
            (true, 5122) => f64::from(i16::MAX),
            (true, 5123) => f64::from(u16::MAX),
            _ => 1.0,
        };
        let end = |values: &Option<Vec<f64>>| match values.as_deref() {
            Some(&[x, y, z]) => Ok([x / whole, y / whole, z / whole]),
            _ => Err("it does not state the extents of its positions".to_owned()),
        };
        Ok([end(&self.min)?, end(&self.max)?])
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    /// A file with these nodes in its scene (of node 0), and a mesh from (0, 0, 0) to (1, 2, 3).
    fn with(nodes: &str) -> String {
        format!(
            r#"{{"asset":{{"version":"2.0"}},"scene":0,"scenes":[{{"nodes":[0]}}],"nodes":[{nodes}],
            "meshes":[{{"primitives":[{{"attributes":{{"NORMAL":7,"POSITION":0}}}}]}}],
            "accessors":[{{"componentType":5126,"count":2,"type":"VEC3","min":[0,0,0],"max":[1,2,3]}}]}}"#
        )
    }

    fn of(nodes: &str) -> Bounds {
        bounds(with(nodes).as_bytes()).unwrap()
    }

    /// The same in a binary container.
    fn binary(json: &str) -> Vec<u8> {
        let length = json.len() as u32;
        let mut bytes = MAGIC.to_vec();
        [2, HEAD as u32 + length, length].iter().for_each(|x| bytes.extend(x.to_le_bytes()));
        bytes.extend(JSON);
        bytes.extend(json.as_bytes());
        bytes
    }

    fn assert_near(found: Bounds, low: [f64; 3], high: [f64; 3]) {
        let off = (found.low - Point3::from(low)).norm() + (found.high - Point3::from(high)).norm();
        assert!(off < 1e-12, "{found:?}");
    }

    #[test]
    fn y_becomes_z() {
        assert_near(of(r#"{"mesh":0}"#), [0.0, -3.0, 0.0], [1.0, 0.0, 2.0]);
    }

    #[test]
    fn nodes_move_what_they_hold() {
        // By 90° about y, in glTF's axes: (x, y, z) to (z, y, -x); then up.
        let half = std::f64::consts::FRAC_1_SQRT_2;
        let turned = format!(
            r#"{{"children":[1],"translation":[10,0,0]}},{{"mesh":0,"rotation":[0,{half},0,{half}],"scale":[1,1,2]}}"#
        );
        assert_near(of(&turned), [10.0, 0.0, 0.0], [16.0, 1.0, 2.0]);
        let matrix =
            r#"{"children":[1],"translation":[10,0,0]},{"mesh":0,"matrix":[0,0,-1,0, 0,1,0,0, 2,0,0,0, 0,0,0,1]}"#;
        assert_near(of(matrix), [10.0, 0.0, 0.0], [16.0, 1.0, 2.0]);
    }

    #[test]
    fn only_what_the_scene_holds_counts() {
        let beside = r#"{"mesh":0},{"mesh":0,"translation":[100,0,0]}"#;
        assert_near(of(beside), [0.0, -3.0, 0.0], [1.0, 0.0, 2.0]);
        let without_scene = with(beside).replace(r#""scenes":[{"nodes":[0]}],"#, "");
        assert_near(bounds(without_scene.as_bytes()).unwrap(), [0.0, -3.0, 0.0], [101.0, 0.0, 2.0]);
    }

    #[test]
    fn quantised_positions_are_fractions() {
        let quantised =
            with(r#"{"mesh":0}"#).replace("5126", "5121,\"normalized\":true").replace("[1,2,3]", "[255,51,0]");
        assert_near(bounds(quantised.as_bytes()).unwrap(), [0.0; 3], [1.0, 0.0, 0.2]);
    }

    #[test]
    fn a_binary_file_is_read_wherever_it_ends_well() {
        let whole = binary(&with(r#"{"mesh":0}"#));
        assert_near(bounds(&whole).unwrap(), [0.0, -3.0, 0.0], [1.0, 0.0, 2.0]);
        for end in 4..whole.len() {
            assert_eq!(bounds(&whole[..end]).unwrap_err(), "it is a glTF that is cut off", "{end}");
        }
    }

    #[test]
    fn what_is_damaged_is_refused() {
        let told = |text: &str| bounds(text.as_bytes()).unwrap_err();
        assert_eq!(told(&with(r#"{"children":[0]}"#)), "its scene places more than 1000000 nodes and meshes");
        assert_eq!(told(&with(r#"{"children":[4]}"#)), "it names node 4, which it does not have");
        assert_eq!(told(&with(r#"{"mesh":4}"#)), "it names mesh 4, which it does not have");
        assert_eq!(told(&with("{}")), "it has no vertices");
        let without = with(r#"{"mesh":0}"#).replace("\"max\"", "\"most\"");
        assert_eq!(told(&without), "it does not state the extents of its positions");
        let vast = with(r#"{"mesh":0,"scale":[1e300,1,1]}"#).replace("[1,2,3]", "[1e300,2,3]");
        assert_eq!(told(&vast), "a vertex of it has no place");
        assert_eq!(told(&with("{}").replace("2.0", "1.0")), "it is a glTF 1.0, not 2.0");
        assert!(told("{").starts_with("it is no glTF 2.0: EOF"));
        assert_eq!(bounds(b"glTF\x01\0\0\0\0\0\0\0\0\0\0\0").unwrap_err(), "it is a binary glTF of version 1, not 2");
    }
}
