//! Where a mesh is that a URDF names by a path, or by its place in a package of ROS.
//!
//! A package is looked for in the folders that the model states, then in those of `ROS_PACKAGE_PATH` and
//! `AMENT_PREFIX_PATH`, then in the URDF's own folder and in all above it. In each, it is the folder itself (by its
//! name or its `package.xml`), a folder in it, or one in its `share`. A relative path is looked for in the URDF's
//! folder, then in the folders that the model states.

use std::path::{Path, PathBuf};

/// Variables with the folders of packages.
const ENVIRONMENT: [&str; 2] = ["ROS_PACKAGE_PATH", "AMENT_PREFIX_PATH"];

/// Where meshes are looked for.
pub(super) struct MeshSearch {
    folder: PathBuf,
    stated: Vec<PathBuf>,
    environment: Vec<PathBuf>,
}

impl MeshSearch {
    pub(super) fn new(urdf: &Path, stated: &[PathBuf]) -> Self {
        // An absolute path, whose folders above can be told.
        let file = std::path::absolute(urdf).unwrap_or_else(|_| urdf.to_owned());
        let values = ENVIRONMENT.iter().filter_map(std::env::var_os);
        MeshSearch {
            folder: file.parent().unwrap_or(Path::new("")).to_owned(),
            stated: stated.to_vec(),
            environment: values.flat_map(|value| std::env::split_paths(&value).collect::<Vec<_>>()).collect(),
        }
    }

    /// The file of a mesh.
    ///
    /// # Errors
    /// That there is none, and what to do about it.
    pub(super) fn find(&self, name: &str) -> Result<PathBuf, String> {
        let package = name.strip_prefix("package://").or_else(|| name.strip_prefix("model://"));
        match package.map(|path| path.split_once('/').unwrap_or((path, ""))) {
            Some((package, rest)) => self.in_package(package, rest).ok_or_else(|| {
                format!("is not found: name the folder with the package `{package}` in package_paths of [robot]")
            }),
            None => self.at(name.strip_prefix("file://").unwrap_or(name)).ok_or_else(|| {
                "is not found: its path is relative to the URDF's folder, or to one in package_paths of [robot]"
                    .to_owned()
            }),
        }
    }

    fn at(&self, path: &str) -> Option<PathBuf> {
        std::iter::once(&self.folder).chain(&self.stated).map(|folder| folder.join(path)).find(|path| path.is_file())
    }

    fn in_package(&self, package: &str, rest: &str) -> Option<PathBuf> {
        let folders = self.stated.iter().chain(&self.environment).map(PathBuf::as_path).chain(self.folder.ancestors());
        let of = |folder: &Path| {
            let inside = [folder.join(package), folder.join("share").join(package)];
            is_package(folder, package).then(|| folder.to_owned()).into_iter().chain(inside)
        };
        folders.flat_map(of).map(|package| package.join(rest)).find(|path| path.is_file())
    }
}

/// Whether a folder is a package, by its name or its description.
fn is_package(folder: &Path, package: &str) -> bool {
    let described = || btr_io::read_text(&folder.join("package.xml")).unwrap_or_default();
    folder.file_name().is_some_and(|name| name == package) || described().contains(&format!("<name>{package}</name>"))
}
