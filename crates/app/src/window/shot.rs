//! Pictures of the scene as files: one, or many from all sides. They are drawn between the window's own, so that it answers meanwhile.

use std::path::{Path, PathBuf};
use std::thread::JoinHandle;

use super::modeler::Modeler;
use crate::cli::picture::png_file;
use crate::cli::staged::StagedFiles;
use crate::view::{Canvas, Look, Screen};

/// What is wished.
#[derive(Clone, Debug, PartialEq)]
pub struct Wanted {
    /// The file, or the directory of many.
    pub path: PathBuf,
    /// Pixels for one of the window's.
    pub scale: u32,
    /// Pictures from all sides, if not one alone.
    pub turns: Option<u32>,
}

/// Pictures that are being drawn.
pub struct Shot {
    wanted: Wanted,
    look: Look,
    size: [u32; 2],
    drawn: u32,
    /// Of many: they appear together.
    staged: Option<StagedFiles>,
    /// What is being written: packing takes longer than drawing.
    writing: Option<JoinHandle<Result<Option<StagedFiles>, String>>>,
}

impl Shot {
    /// Of a look, in a window of so many pixels.
    ///
    /// # Errors
    /// That no file can be made there.
    pub fn new(wanted: Wanted, look: Look, window: [u32; 2]) -> Result<Self, String> {
        let staged = match wanted.turns {
            None => None,
            Some(_) => Some(StagedFiles::new("the directory", &wanted.path).map_err(|e| e.to_string())?),
        };
        Ok(Self {
            size: window.map(|n| n * wanted.scale),
            wanted,
            look,
            drawn: 0,
            staged,
            writing: None,
        })
    }

    fn count(&self) -> u32 {
        self.wanted.turns.unwrap_or(1)
    }

    /// What is drawn next.
    fn look(&self) -> Look {
        let mut look = self.look;
        look.camera.turn[0] += std::f64::consts::TAU * f64::from(self.drawn) / f64::from(self.count());
        look
    }

    fn write(&mut self, pixels: Vec<u8>) {
        let (path, size, n) = (
            self.wanted.path.clone(),
            self.size.map(|n| n as usize),
            self.drawn,
        );
        let staged = self.staged.take();
        self.writing = Some(std::thread::spawn(move || {
            written(&path, size, &pixels, staged, n)
        }));
        self.drawn += 1;
    }

    /// Draws the next, as far as there is time; whether all are done.
    fn step(&mut self, canvas: &mut Canvas) -> Result<bool, String> {
        if !self.is_written()? {
            return Ok(false);
        }
        if self.drawn == self.count() {
            if let Some(staged) = self.staged.take() {
                staged.publish().map_err(|e| e.to_string())?;
            }
            return Ok(true);
        }
        let ([w, h], most) = (self.size, canvas.most_pixels());
        if w.max(h) > most {
            return Err(format!(
                "a picture of {w} by {h} pixels is more than the graphics driver draws, {most} a side; take it smaller"
            ));
        }
        if let Some(pixels) = canvas.pixels_so_far(&self.look(), self.size)? {
            self.write(pixels);
        }
        Ok(false)
    }

    /// Takes back what writes; whether nothing is being written any more.
    fn is_written(&mut self) -> Result<bool, String> {
        if self
            .writing
            .as_ref()
            .is_some_and(|writing| !writing.is_finished())
        {
            return Ok(false);
        }
        if let Some(writing) = self.writing.take() {
            let done = writing.join();
            self.staged = done.unwrap_or_else(|_| Err("the picture could not be packed".into()))?;
        }
        Ok(true)
    }
}

fn written(
    path: &Path,
    size: [usize; 2],
    pixels: &[u8],
    staged: Option<StagedFiles>,
    n: u32,
) -> Result<Option<StagedFiles>, String> {
    match staged {
        None => png_file(path, size, pixels)
            .map(|()| None)
            .map_err(|e| e.to_string()),
        Some(mut staged) => {
            let done = staged.write(&format!("{n:04}.png"), |path| png_file(path, size, pixels));
            done.map(|()| Some(staged)).map_err(|e| e.to_string())
        }
    }
}

impl Modeler {
    /// Draws the next of the pictures that are wished, as far as there is time; whether one is under way.
    pub(super) fn shoot(&mut self, window: [u32; 2]) -> bool {
        if let Some(wanted) = self.bench.shot.wanted.take() {
            match Shot::new(wanted, self.bench.look, window) {
                Ok(shot) => self.shot = Some(shot),
                Err(why) => self.bench.tell(why, true),
            }
        }
        let Some(mut shot) = self.shot.take() else {
            return false;
        };
        if std::mem::take(&mut self.bench.shot.is_cancelled) {
            // What is staged goes with it; a single picture that is being written comes whole.
            self.bench.shot.progress = None;
            self.bench.tell("the pictures were left out".into(), false);
            return false;
        }
        let canvas = self.screen.as_mut().map(|Screen { canvas, .. }| canvas);
        let lacks = || "without a graphics driver no picture can be drawn".to_string();
        match canvas.ok_or_else(lacks).and_then(|canvas| shot.step(canvas)) {
            Ok(true) => {
                self.bench.shot.progress = None;
                self.bench
                    .tell(format!("{} is written", shot.wanted.path.display()), false);
                false
            }
            Ok(false) => {
                self.bench.shot.progress = Some((shot.drawn, shot.count()));
                self.shot = Some(shot);
                true
            }
            Err(why) => {
                self.bench.shot.progress = None;
                self.bench.tell(why, true);
                false
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use document::Object;
    use formats::field::FieldMeta;
    use glam::{DAffine3, DVec3};

    use super::*;
    use crate::cli::desk_files;
    use crate::view::{BUDGET, Budget, Camera, Card, LINE, Mode, Paper, SKY, Shape, Show};

    fn easel(card: &Card) -> (Canvas, Look) {
        let (_, Object { field, .. }) = desk_files::clay_block().unwrap();
        let object = Object::of(field, FieldMeta::default());
        let mut shape = Shape::new(&object, 0.0, DAffine3::IDENTITY, Budget::PROCESSOR).unwrap();
        let mut canvas = Canvas::new(&card.device, &card.queue, SKY, BUDGET);
        canvas.begin(DVec3::ZERO, 40.0);
        shape
            .all("clay", DVec3::ZERO)
            .iter()
            .for_each(|patch| canvas.put(patch));
        let look = Look {
            camera: Camera::onto(DVec3::ZERO, 40.0, DVec3::Y),
            cut: None,
            paint: true,
            mode: Mode::Mesh,
            density: [0.0, 1.0],
            paper: Paper::Dark,
            show: Show::default(),
            line: LINE,
        };
        (canvas, look)
    }

    fn taken(wanted: Wanted, look: Look, canvas: &mut Canvas) {
        let mut shot = Shot::new(wanted, look, [60, 40]).unwrap();
        while !shot.step(canvas).unwrap() {
            std::thread::sleep(std::time::Duration::from_millis(1));
        }
    }

    #[test]
    fn pictures_have_the_size_that_is_asked_for_and_turns_appear_together() {
        let card = match Card::open() {
            Ok(card) => card,
            Err(why) if std::env::var_os("ISOCLAY_NEEDS_CARD").is_some() => panic!("pictures: {why}"),
            Err(why) => return eprintln!("SKIPPED pictures as files: {why}"),
        };
        let (mut canvas, look) = easel(&card);
        let scratch = tempfile::tempdir().unwrap();
        let path = scratch.path().join("one.png");
        let wanted = Wanted {
            path: path.clone(),
            scale: 4,
            turns: None,
        };
        taken(wanted, look, &mut canvas);
        let file = std::io::BufReader::new(std::fs::File::open(&path).unwrap());
        let reader = png::Decoder::new(file).read_info().unwrap();
        assert_eq!((reader.info().width, reader.info().height), (240, 160));

        let turns = scratch.path().join("turns");
        let wanted = Wanted {
            path: turns.clone(),
            scale: 1,
            turns: Some(3),
        };
        let names = || {
            let files = std::fs::read_dir(&turns).into_iter().flatten();
            let mut names: Vec<_> = files.map(|f| f.unwrap().file_name()).collect();
            names.sort();
            names
        };
        // One that is left out leaves nothing.
        let mut shot = Shot::new(wanted.clone(), look, [60, 40]).unwrap();
        assert!(!shot.step(&mut canvas).unwrap());
        while !shot.is_written().unwrap() {
            std::thread::sleep(std::time::Duration::from_millis(1));
        }
        drop(shot);
        assert!(names().is_empty(), "{:?}", names());
        taken(wanted, look, &mut canvas);
        assert_eq!(names(), ["0000.png", "0001.png", "0002.png"]);
        let bytes = |n: usize| std::fs::read(turns.join(format!("000{n}.png"))).unwrap();
        assert!(bytes(0) != bytes(1) && bytes(1) != bytes(2));
    }
}
