//! What is asked of a volume: three coarse slices with a box over them, and what that will hold.

use std::ffi::OsString;
use std::path::{Path, PathBuf};

use egui::{Color32, ColorImage, DragValue, Rect, Sense, Stroke, TextureHandle, TextureOptions, Ui};
use formats::ReadLimits;
use formats::volumes::{Orientation, Preview, Volume, VolumeHeader, VolumeOptions};

use super::{WIDE, bytes_of};
use crate::cli::quantity::{human_count, human_number};

/// Voxels of the coarse slices along their longest side, at most.
const COARSE: usize = 96;

/// A region and a stride, and bytes.
type Needs = (([[usize; 2]; 3], usize), u64);

/// A volume of which a part is to be opened.
pub struct Part {
    path: PathBuf,
    preview: Preview,
    /// Every so many voxels of it.
    coarse: Volume,
    stride_of_coarse: usize,
    /// For each axis, the first voxel and the one after the last.
    region: [[usize; 2]; 3],
    stride: usize,
    /// Where the slices are, in shares.
    at: [f32; 3],
    pictures: [Option<TextureHandle>; 3],
    /// What reading a region at a stride holds.
    needs: Option<Needs>,
    drags: Option<(usize, [f32; 2])>,
}

impl Part {
    /// Looks at a file.
    ///
    /// # Errors
    /// Why it cannot be read.
    pub fn of(path: &Path) -> Result<Self, String> {
        let all = VolumeOptions::default();
        let preview = formats::volumes::peek(path, &all).map_err(|e| e.to_string())?;
        let longest = preview.file_dims.into_iter().max().unwrap_or(1);
        let stride_of_coarse = longest.div_ceil(COARSE);
        let every = VolumeOptions {
            stride: [stride_of_coarse; 3],
            ..all
        };
        let limits = ReadLimits::default();
        let coarse = formats::volumes::read(path, &every, &limits).map_err(|e| e.to_string())?;
        Ok(Self {
            region: preview.file_dims.map(|n| [0, n]),
            preview,
            coarse,
            stride_of_coarse,
            stride: 1,
            at: [0.5; 3],
            pictures: [None, None, None],
            needs: None,
            path: path.to_path_buf(),
            drags: None,
        })
    }

    /// What `fit` is told to read.
    pub fn options(&self) -> Vec<OsString> {
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

    /// Bytes that reading them holds.
    fn bytes(&mut self) -> u64 {
        let (region, stride) = (self.region, self.stride);
        if let Some((_, bytes)) = self.needs.filter(|(of, _)| *of == (region, stride)) {
            return bytes;
        }
        // All files of a directory would be looked at for every step of a drag.
        let told = (!self.path.is_dir()).then(|| {
            let part = VolumeOptions {
                region: Some(region),
                stride: [stride; 3],
                ..VolumeOptions::default()
            };
            formats::volumes::peek(&self.path, &part).ok()
        });
        let each = size_of::<f32>() as u64;
        let whole = each * self.preview.header.voxel_count() as u64;
        let own = self.preview.read_bytes.saturating_sub(whole);
        let bytes = told
            .flatten()
            .map_or(own + each * self.voxels() as u64, |part| part.read_bytes);
        self.needs = Some(((region, stride), bytes));
        bytes
    }

    /// What it is, and the box over it.
    pub fn show(&mut self, ui: &mut Ui) {
        let dims = self.preview.file_dims;
        ui.label(about(&self.preview));
        for note in &self.preview.notes {
            ui.weak(note);
        }
        ui.label("Drag over the slices to draw the box, or type voxels");
        ui.horizontal(|ui| {
            for axis in 0..3 {
                slice(ui, self, dims, axis);
            }
        });
        egui::Grid::new("part").num_columns(5).show(ui, |ui| {
            for (axis, name) in ["x", "y", "z"].into_iter().enumerate() {
                let [from, to] = &mut self.region[axis];
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
            ui.add(DragValue::new(&mut self.stride).range(1..=16))
                .labelled_by(label.id);
        });
        let bytes = self.bytes();
        bytes_of(
            ui,
            &format!("{} voxels", human_count(self.voxels())),
            bytes,
            "take a smaller part, or fewer voxels",
        );
    }
}

/// The kind of a volume, its voxels and sizes, and which way it lies.
fn about(preview: &Preview) -> String {
    let header = &preview.header;
    let [x, y, z] = preview.file_dims;
    let spacing = header.spacing();
    let size = glam::DVec3::new(x as f64, y as f64, z as f64) * spacing;
    let triple = |p: glam::DVec3| p.to_array().map(human_number).join(" × ");
    format!(
        "{}, {x} × {y} voxels in {z} slices, {} {unit} apart: {} {unit}; {}",
        preview.format,
        triple(spacing),
        triple(size),
        lies(header),
        unit = header.unit,
    )
}

/// Which way the axes of a volume run in the patient, as radiologists write it.
fn lies(header: &VolumeHeader) -> String {
    if header.orientation == Orientation::Spacings {
        return "the file does not tell which way it lies".into();
    }
    let letter = |axis: usize| {
        let way = header.world_from_voxel.matrix3.col(axis);
        let along = way.abs().max_position();
        let [forth, back] = [['R', 'L'], ['A', 'P'], ['S', 'I']][along];
        if way[along] > 0.0 { forth } else { back }
    };
    format!("its axes run {}", (0..3).map(letter).collect::<String>())
}

/// A slice across an axis, with the box over it.
fn slice(ui: &mut Ui, part: &mut Part, dims: [usize; 3], axis: usize) {
    let stride = part.stride_of_coarse;
    let [u, v] = [[1, 2], [0, 2], [0, 1]][axis];
    let coarse = part.coarse.header.dims;
    let spacing = part.coarse.header.spacing();
    let size = egui::vec2(
        dims[u] as f32 * spacing[u] as f32,
        dims[v] as f32 * spacing[v] as f32,
    );
    let size = size * (WIDE / size.max_elem().max(f32::MIN_POSITIVE));
    let picture = part.pictures[axis].get_or_insert_with(|| {
        let image = image(&part.coarse, coarse, axis, part.at[axis]);
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
