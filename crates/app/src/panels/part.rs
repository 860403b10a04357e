//! How much of a volume is opened: three coarse slices, a box over them, and what that will hold.

use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, channel};

use egui::{Color32, ColorImage, DragValue, Rect, Sense, Stroke, TextureHandle, TextureOptions, Ui};
use formats::ReadLimits;
use formats::volumes::{Preview, Volume, VolumeOptions};

use crate::cli::desk_files;
use crate::cli::quantity::{human_bytes, human_count};
use crate::window::Bench;
use crate::window::orders::Order;

/// Files up to this are opened at once, bytes.
pub const LARGE: u64 = 64 << 20;
/// Voxels of the coarse slices along their longest side, at most.
const COARSE: usize = 96;
/// Points of a slice along its longest side.
const WIDE: f32 = 190.0;

/// What is known of a file before it is read whole.
type Known = Result<(Preview, Volume, usize), String>;

/// A volume of which a part is to be opened.
pub struct Part {
    path: PathBuf,
    told: Receiver<Known>,
    known: Option<Known>,
    /// For each axis, the first voxel and the one after the last.
    region: [[usize; 2]; 3],
    stride: usize,
    /// Where the slices are, in shares.
    at: [f32; 3],
    pictures: [Option<TextureHandle>; 3],
    drags: Option<(usize, [f32; 2])>,
}

impl Part {
    /// Begins to look at a file, on a thread of its own.
    pub fn of(path: PathBuf) -> Self {
        let (tell, told) = channel();
        let file = path.clone();
        std::thread::spawn(move || {
            let _ = tell.send(look(&file));
        });
        Self {
            path,
            told,
            known: None,
            region: [[0, 1]; 3],
            stride: 1,
            at: [0.5; 3],
            pictures: [None, None, None],
            drags: None,
        }
    }

    /// What `fit` is told to read.
    fn options(&self) -> Vec<OsString> {
        let range = |[from, to]: [usize; 2]| format!("{from}:{to}");
        let region = self.region.map(range).join(",");
        let mut options: Vec<OsString> = vec!["--region".into(), region.into()];
        if self.stride > 1 {
            options.extend(["--stride".into(), self.stride.to_string().into()]);
        }
        options
    }

    /// Voxels that would be read.
    fn voxels(&self) -> usize {
        let along = |[from, to]: [usize; 2]| (to - from).div_ceil(self.stride);
        self.region.into_iter().map(along).product()
    }
}

/// Whether a file is so large that it is asked first how much of it is wanted.
pub fn is_large(path: &Path) -> bool {
    path.metadata()
        .is_ok_and(|file| file.is_file() && file.len() > LARGE)
        && formats::volumes::peek(path, &VolumeOptions::default()).is_ok()
}

fn look(path: &Path) -> Known {
    let all = VolumeOptions::default();
    let preview = formats::volumes::peek(path, &all).map_err(|e| e.to_string())?;
    let longest = preview.file_dims.into_iter().max().unwrap_or(1);
    let stride = longest.div_ceil(COARSE);
    let coarse = VolumeOptions {
        stride: [stride; 3],
        ..all
    };
    let volume = formats::volumes::read(path, &coarse, &ReadLimits::default()).map_err(|e| e.to_string())?;
    Ok((preview, volume, stride))
}

/// Over all else, while it is asked how much is wanted.
pub fn part(context: &egui::Context, bench: &mut Bench) {
    let Some(mut part) = bench.part.take() else { return };
    if part.known.is_none() {
        part.known = part.told.try_recv().ok();
        if let Some(Ok((preview, ..))) = &part.known {
            part.region = preview.file_dims.map(|n| [0, n]);
        }
        context.request_repaint_after(std::time::Duration::from_millis(50));
    }
    let mut answer = None;
    let modal = egui::Modal::new(egui::Id::unique("part")).show(context, |ui| {
        ui.set_width(3.0 * WIDE + 24.0);
        let name = part
            .path
            .file_name()
            .unwrap_or_default()
            .to_string_lossy()
            .into_owned();
        ui.heading(format!("How much of {name}?"));
        match part.known.take() {
            None => {
                ui.horizontal(|ui| {
                    ui.spinner();
                    ui.label("Looking at it");
                });
            }
            Some(Err(why)) => {
                ui.colored_label(ui.visuals().error_fg_color, &why);
                part.known = Some(Err(why));
            }
            Some(Ok(known)) => {
                show(ui, &mut part, &known);
                part.known = Some(Ok(known));
            }
        }
        ui.horizontal(|ui| {
            let can = matches!(part.known, Some(Ok(_)));
            if ui.add_enabled(can, egui::Button::new("Open this part")).clicked() {
                answer = Some(Order::OpenPart(part.path.clone(), part.options()));
            }
            if ui.button("Open all of it").clicked() {
                answer = Some(Order::Open(part.path.clone()));
            }
            if ui.button("Not now").clicked() {
                answer = Some(Order::Untry);
            }
        });
    });
    match answer {
        Some(order) => bench.order(order),
        None if modal.should_close() => {}
        None => bench.part = Some(part),
    }
}

fn show(ui: &mut Ui, part: &mut Part, (preview, volume, stride): &(Preview, Volume, usize)) {
    let dims = preview.file_dims;
    ui.label("Drag over the slices to draw the box, or type voxels");
    ui.horizontal(|ui| {
        for axis in 0..3 {
            slice(ui, part, volume, *stride, dims, axis);
        }
    });
    egui::Grid::new("part").num_columns(5).show(ui, |ui| {
        for (axis, name) in ["x", "y", "z"].into_iter().enumerate() {
            let [from, to] = &mut part.region[axis];
            let label = ui.label(format!("{name} from"));
            ui.add(DragValue::new(from).range(0..=*to - 1))
                .labelled_by(label.id);
            let label = ui.label(format!("{name} to"));
            ui.add(DragValue::new(to).range(*from + 1..=dims[axis]))
                .labelled_by(label.id);
            ui.label(format!("of {}", dims[axis]));
            ui.end_row();
        }
    });
    ui.horizontal(|ui| {
        let label = ui
            .label("Every so many voxels")
            .on_hover_text("1 takes all; voxels between are left out, not averaged");
        ui.add(DragValue::new(&mut part.stride).range(1..=16))
            .labelled_by(label.id);
    });
    // Reading takes some room of its own, however much is read.
    let each = size_of::<f32>() as u64;
    let own = preview
        .read_bytes
        .saturating_sub(each * preview.header.voxel_count() as u64);
    let bytes = own + each * part.voxels() as u64;
    let (most, _) = desk_files::memory();
    let most = most.map(|most| most.0);
    let told = format!(
        "{} voxels, {} to read them",
        human_count(part.voxels()),
        human_bytes(bytes)
    );
    match most.filter(|most| bytes > most / 2) {
        Some(most) => {
            let text = format!(
                "{told}; the fit may hold {}: take a smaller part, or fewer voxels",
                human_bytes(most)
            );
            ui.colored_label(ui.visuals().warn_fg_color, text);
        }
        None => drop(ui.label(told)),
    }
}

/// A slice across an axis, with the box over it.
fn slice(ui: &mut Ui, part: &mut Part, volume: &Volume, stride: usize, dims: [usize; 3], axis: usize) {
    let [u, v] = [[1, 2], [0, 2], [0, 1]][axis];
    let coarse = volume.header.dims;
    let spacing = volume.header.spacing();
    let size = egui::vec2(
        dims[u] as f32 * spacing[u] as f32,
        dims[v] as f32 * spacing[v] as f32,
    );
    let size = size * (WIDE / size.max_elem().max(f32::MIN_POSITIVE));
    let picture = part.pictures[axis].get_or_insert_with(|| {
        let image = image(volume, coarse, axis, part.at[axis]);
        ui.ctx()
            .load_texture(format!("part {axis}"), image, TextureOptions::LINEAR)
    });
    let (rect, response) = ui.allocate_exact_size(size, Sense::click_and_drag());
    ui.painter().image(
        picture.id(),
        rect,
        Rect::from_min_max(egui::pos2(0.0, 0.0), egui::pos2(1.0, 1.0)),
        Color32::WHITE,
    );
    // The third axis goes up.
    let share = |p: egui::Pos2| {
        [
            ((p.x - rect.left()) / rect.width()).clamp(0.0, 1.0),
            ((rect.bottom() - p.y) / rect.height()).clamp(0.0, 1.0),
        ]
    };
    if let Some(at) = response.interact_pointer_pos() {
        let now = share(at);
        let (_, from) = *part.drags.get_or_insert((axis, now));
        for (n, along) in [u, v].into_iter().enumerate() {
            let ends =
                [from[n].min(now[n]), from[n].max(now[n])].map(|s| (s * dims[along] as f32).round() as usize);
            if ends[1] > ends[0] + stride {
                part.region[along] = ends;
            }
        }
    }
    if response.drag_stopped() || response.clicked() {
        part.drags = None;
    }
    let place = |along: usize, voxel: usize| voxel as f32 / dims[along] as f32;
    let [left, right] = part.region[u].map(|n| rect.left() + place(u, n) * rect.width());
    let [bottom, top] = part.region[v].map(|n| rect.bottom() - place(v, n) * rect.height());
    let own = Rect::from_min_max(egui::pos2(left, top), egui::pos2(right, bottom));
    ui.painter().rect_stroke(
        own,
        0.0,
        Stroke::new(1.5, Color32::from_rgb(255, 180, 80)),
        egui::StrokeKind::Inside,
    );
}

fn image(volume: &Volume, dims: [usize; 3], axis: usize, at: f32) -> ColorImage {
    let [u, v] = [[1, 2], [0, 2], [0, 1]][axis];
    let across = ((at * dims[axis] as f32) as usize).min(dims[axis] - 1);
    let value = |i: usize, j: usize| {
        let mut voxel = [0; 3];
        (voxel[axis], voxel[u], voxel[v]) = (across, i, dims[v] - 1 - j);
        volume.values[voxel[0] + dims[0] * (voxel[1] + dims[1] * voxel[2])]
    };
    let mut all: Vec<f32> = (0..dims[v])
        .flat_map(|j| (0..dims[u]).map(move |i| (i, j)))
        .map(|(i, j)| value(i, j))
        .collect();
    let gray_of = |sorted: &[f32], share: f32| sorted[((sorted.len() - 1) as f32 * share) as usize];
    let mut sorted = all.clone();
    sorted.sort_by(f32::total_cmp);
    let (black, white) = (gray_of(&sorted, 0.02), gray_of(&sorted, 0.99));
    let gray =
        |x: f32| (255.0 * ((x - black) / (white - black).max(f32::MIN_POSITIVE)).clamp(0.0, 1.0)) as u8;
    let pixels: Vec<u8> = all.drain(..).map(gray).collect();
    ColorImage::from_gray([dims[u], dims[v]], &pixels)
}
