//! What is in memory when a run's folder is gone: it is written beside it, so that the run can be resumed there.

use super::run_error::RunError;
use btr_core::coevolve::{Entry, TestVerdict};
use btr_io::Meta;
use std::io::Write;
use std::path::{Path, PathBuf};

/// Writes the files of a run and its real tests into a new folder beside the one that is gone. Returns the error that
/// tells where they are.
pub(super) fn rescue(folder: &Path, files: &[(&str, &[u8])], tests: &[Entry]) -> RunError {
    let rescued = free_folder(folder);
    match write(&rescued, files, tests) {
        Ok(()) => RunError::FolderGone { folder: folder.to_owned(), rescued },
        Err(why) => RunError::Lost { folder: folder.to_owned(), rescued, why },
    }
}

/// The first of `NAME.rescued`, `NAME.rescued-2`, ... that is not there.
fn free_folder(folder: &Path) -> PathBuf {
    let called = |ending: &str| {
        let mut name = folder.file_name().unwrap_or_default().to_owned();
        name.push(ending);
        folder.with_file_name(name)
    };
    let mut folders = std::iter::once(called(".rescued")).chain((2..).map(|k| called(&format!(".rescued-{k}"))));
    folders.find(|path| !path.exists()).unwrap_or_default()
}

fn write(folder: &Path, files: &[(&str, &[u8])], tests: &[Entry]) -> Result<(), String> {
    let text = |path: &Path, content: &[u8]| {
        let written = path.parent().map_or(Ok(()), std::fs::create_dir_all);
        let written = written.and_then(|()| btr_io::write_whole(path, |file| file.write_all(content)));
        written.map_err(|why| format!("{}: {why}", path.display()))
    };
    files.iter().try_for_each(|(name, content)| text(&folder.join(name), content))?;
    for test in tests {
        let of_test = folder.join("transfers").join(format!("{:04}", test.trial.number));
        match (&test.verdict, test.behaviour()) {
            (TestVerdict::Failed { why }, _) => text(&of_test.join("failed.txt"), why.as_bytes())?,
            (TestVerdict::Done { .. }, Some(real)) => {
                std::fs::create_dir_all(&of_test).map_err(|why| format!("{}: {why}", of_test.display()))?;
                let written = btr_io::write_log(&of_test.join("log.mcap"), &real.log, &Meta::default());
                written.map_err(|why| why.to_string())?;
            }
            (TestVerdict::Done { .. }, None) => {}
        }
    }
    Ok(())
}
