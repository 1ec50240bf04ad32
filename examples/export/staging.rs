//! Files that appear under their own names only when all of them are whole.

use std::fs::{self, File};
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

/// Files under temporary names in one folder. Dropped before [`publish`](Self::publish), it leaves nothing behind.
pub struct Staging {
    folder: PathBuf,
    /// Folders that were made for it, innermost first.
    made: Vec<PathBuf>,
    names: Vec<&'static str>,
}

impl Staging {
    /// Makes the folder if it is not there.
    pub fn new(folder: &Path) -> io::Result<Self> {
        let missing = |path: &&Path| !path.as_os_str().is_empty() && !path.exists();
        let made = folder.ancestors().take_while(missing).map(Path::to_path_buf).collect();
        let staging = Self { folder: folder.into(), made, names: Vec::new() };
        fs::create_dir_all(folder)?;
        Ok(staging)
    }

    /// Writes a file that is to get `name`, and returns what `content` returns.
    pub fn write<T>(
        &mut self,
        name: &'static str,
        content: impl FnOnce(&mut BufWriter<File>) -> io::Result<T>,
    ) -> io::Result<T> {
        if self.folder.join(name).is_dir() {
            return Err(io::Error::new(io::ErrorKind::IsADirectory, "is a folder"));
        }
        self.names.push(name);
        let mut writer = BufWriter::with_capacity(1 << 20, File::create(self.staged(name))?);
        let result = content(&mut writer)?;
        writer.flush()?;
        Ok(result)
    }

    /// Gives all files their names, over what had them before.
    pub fn publish(mut self) -> io::Result<()> {
        self.made.clear();
        for name in &self.names {
            fs::rename(self.staged(name), self.folder.join(name))?;
        }
        Ok(())
    }

    fn staged(&self, name: &str) -> PathBuf {
        self.folder.join(format!(".{name}.{}.part", std::process::id()))
    }
}

impl Drop for Staging {
    fn drop(&mut self) {
        // Files that were published are no longer here under their temporary names.
        for name in &self.names {
            let _ = fs::remove_file(self.staged(name));
        }
        for folder in &self.made {
            let _ = fs::remove_dir(folder);
        }
    }
}
