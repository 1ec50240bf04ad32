//! Writes files under temporary names, and renames them only when all of them are complete.

use std::fs::{self, File};
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

/// Files under temporary names in one folder. They are removed unless [`publish`](Self::publish) succeeds.
pub struct Staging {
    folder: PathBuf,
    /// Folders that were created for it, innermost first.
    made: Vec<PathBuf>,
    names: Vec<&'static str>,
}

impl Staging {
    /// Creates the folder if it does not exist.
    pub fn new(folder: &Path) -> io::Result<Self> {
        let missing = |path: &&Path| !path.as_os_str().is_empty() && !path.exists();
        let made = folder.ancestors().take_while(missing).map(Path::to_path_buf).collect();
        let staging = Self { folder: folder.into(), made, names: Vec::new() };
        fs::create_dir_all(folder)?;
        Ok(staging)
    }

    /// Writes a file that will be named `name`, and returns the result of `content`.
    pub fn write<T>(
        &mut self,
        name: &'static str,
        content: impl FnOnce(&mut BufWriter<File>) -> io::Result<T>,
    ) -> io::Result<T> {
        self.check_is_no_folder(name)?;
        self.names.push(name);
        let mut writer = BufWriter::with_capacity(1 << 20, File::create(self.staged(name))?);
        let result = content(&mut writer)?;
        writer.flush()?;
        Ok(result)
    }

    /// Renames all files to their names, replacing existing files. If one rename fails, all are undone.
    pub fn publish(mut self) -> io::Result<()> {
        for (number, name) in self.names.iter().enumerate() {
            if let Err(error) = self.put_in_place(name) {
                self.names[..number].iter().for_each(|name| self.take_back(name));
                return Err(error);
            }
        }
        for name in &self.names {
            let _ = fs::remove_file(self.earlier(name));
        }
        self.made.clear();
        Ok(())
    }

    /// Renames a file to its name; an existing file is kept under another name.
    fn put_in_place(&self, name: &str) -> io::Result<()> {
        self.check_is_no_folder(name)?;
        let (place, earlier) = (self.folder.join(name), self.earlier(name));
        match fs::rename(&place, &earlier) {
            Err(error) if error.kind() != io::ErrorKind::NotFound => return Err(error),
            _ => {}
        }
        fs::rename(self.staged(name), &place).inspect_err(|_| drop(fs::rename(&earlier, &place)))
    }

    /// Restores the file that had the name before. Errors are ignored, as nothing more can be done.
    fn take_back(&self, name: &str) {
        let place = self.folder.join(name);
        let _ = fs::rename(&place, self.staged(name));
        let _ = fs::rename(self.earlier(name), place);
    }

    fn check_is_no_folder(&self, name: &str) -> io::Result<()> {
        match self.folder.join(name).is_dir() {
            true => Err(io::Error::new(io::ErrorKind::IsADirectory, format!("{name} is a folder"))),
            false => Ok(()),
        }
    }

    fn staged(&self, name: &str) -> PathBuf {
        self.folder.join(format!(".{name}.{}.part", std::process::id()))
    }

    /// The temporary name of a file that had the name before.
    fn earlier(&self, name: &str) -> PathBuf {
        self.folder.join(format!(".{name}.{}.earlier", std::process::id()))
    }
}

impl Drop for Staging {
    fn drop(&mut self) {
        // Published files no longer have their temporary names.
        for name in &self.names {
            let _ = fs::remove_file(self.staged(name));
        }
        for folder in &self.made {
            let _ = fs::remove_dir(folder);
        }
    }
}
