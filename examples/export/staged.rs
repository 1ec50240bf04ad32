//! Files that appear under their own names only when all of them are whole.

use std::fs::{self, File};
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

/// A file under a temporary name in its folder; removed if it is dropped before [`publish`].
pub struct StagedFile {
    writer: BufWriter<File>,
    staged: PathBuf,
    target: PathBuf,
    /// Folders that were made for it, outermost first; they go too, where nothing else is in them.
    made: Vec<PathBuf>,
}

impl StagedFile {
    /// A new file that is to become `folder/name`. Makes the folder if it is not there.
    pub fn create(folder: &Path, name: &str) -> io::Result<Self> {
        let missing = |folder: &&Path| !folder.as_os_str().is_empty() && !folder.exists();
        let mut made: Vec<PathBuf> = folder.ancestors().take_while(missing).map(Path::to_path_buf).collect();
        made.reverse();
        fs::create_dir_all(folder)?;
        let staged = folder.join(format!(".{name}.{}.part", std::process::id()));
        let writer = BufWriter::with_capacity(1 << 20, File::create(&staged)?);
        Ok(Self { writer, staged, target: folder.join(name), made })
    }
}

impl Write for StagedFile {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.writer.write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.writer.flush()
    }
}

impl Drop for StagedFile {
    fn drop(&mut self) {
        // After `publish` there is nothing under this name, and the folders are not empty.
        let _ = fs::remove_file(&self.staged);
        for folder in self.made.iter().rev() {
            let _ = fs::remove_dir(folder);
        }
    }
}

/// Writes all files out, then gives them their names.
///
/// # Errors
/// When a file can't be written or renamed. Files written before stay only if another one can't be renamed.
pub fn publish<const N: usize>(mut files: [StagedFile; N]) -> io::Result<()> {
    for file in &mut files {
        file.flush()?;
        file.writer.get_ref().sync_all()?;
    }
    for file in &files {
        fs::rename(&file.staged, &file.target)?;
    }
    Ok(())
}
