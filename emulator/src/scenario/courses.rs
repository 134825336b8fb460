//! The course files that a scenario's signals name.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

use super::course::Course;
use super::error::ScenarioError;
use super::file::Scenario;

/// Courses already read, each once for all runs.
#[derive(Debug)]
pub(super) struct Courses {
    /// The scenario's folder, to which paths are relative.
    folder: PathBuf,
    read: Mutex<BTreeMap<PathBuf, Arc<Course>>>,
}

impl Courses {
    /// Creates the courses of a scenario in this folder.
    pub(super) fn in_folder(folder: &Path) -> Self {
        Self {
            folder: folder.to_owned(),
            read: Mutex::new(BTreeMap::new()),
        }
    }

    /// Gives each signal that names a file its contents.
    pub(super) fn fill(&self, scenario: &mut Scenario) -> Result<(), ScenarioError> {
        for (index, signal) in scenario.signal.iter_mut().enumerate() {
            if let Some(path) = &signal.path {
                let wrong =
                    |problem| ScenarioError::of_key(format!("signal.{index}.path"), problem);
                signal.course = Some(self.get(path).map_err(wrong)?);
            }
        }
        Ok(())
    }

    fn get(&self, path: &Path) -> Result<Arc<Course>, String> {
        // A reader that failed left the earlier courses intact.
        let mut read = self.read.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(course) = read.get(path) {
            return Ok(Arc::clone(course));
        }
        let place = self.folder.join(path);
        let bytes = std::fs::read(&place)
            .map_err(|error| format!("cannot read {}: {error}", place.display()))?;
        let course =
            Course::parse(&bytes).map_err(|problem| format!("{}: {problem}", place.display()))?;
        let course = Arc::new(course);
        read.insert(path.to_owned(), Arc::clone(&course));
        Ok(course)
    }
}
