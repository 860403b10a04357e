//! A picture for each eye. Both look straight ahead, with the middle of the picture moved aside, so that what the camera goes round is in
//! the same place in both: eyes that turn towards it would see other heights at the rims.

use eframe::egui_wgpu::wgpu;
use egui::{Pos2, Rect};
use serde::{Deserialize, Serialize};

use super::canvas::Canvas;
use super::laid::Layer;
use super::look::Look;
use super::target::{COLOR, Drawn};
use super::{Camera, Show};

/// As what pictures are copied: as their bytes are.
const BYTES: wgpu::TextureFormat = wgpu::TextureFormat::Rgba8Unorm;

/// How both eyes get pictures of their own; kept from one window to the next.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct Stereo {
    /// Where the pictures are.
    pub pair: Pair,
    /// From one eye to the other, as a share of their way to what the camera goes round.
    pub apart: f64,
}

/// Where the pictures of both eyes are.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Pair {
    /// There is one for both.
    #[default]
    Off,
    /// The left one on the left.
    Beside,
    /// One over the other, the left one red, the right one green and blue.
    Anaglyph,
}

impl Default for Stereo {
    fn default() -> Self {
        Self {
            pair: Pair::Off,
            apart: 1.0 / 30.0,
        }
    }
}

impl Stereo {
    /// The least and the largest way from eye to eye.
    pub const RANGE: [f64; 2] = [0.005, 0.1];

    /// How far aside an eye stands, the left one first: see [`Camera::aside`].
    fn aside(&self) -> [f64; 2] {
        let [least, most] = Self::RANGE;
        [-0.5, 0.5].map(|side| side * self.apart.clamp(least, most))
    }

    /// Pixels that are drawn for one that is shown.
    pub fn load(&self) -> f64 {
        match self.pair {
            Pair::Anaglyph => 2.0,
            Pair::Off | Pair::Beside => 1.0,
        }
    }

    /// Where in a place which eyes see the scene. Of pictures over one another it is the middle between the eyes.
    pub fn views(&self, place: Rect) -> impl Iterator<Item = (Rect, f64)> + use<> {
        let [left, right] = self.aside();
        let middle = place.center().x;
        let views = match self.pair {
            Pair::Beside => [
                Some((place.with_max_x(middle), left)),
                Some((place.with_min_x(middle), right)),
            ],
            Pair::Off | Pair::Anaglyph => [Some((place, 0.0)), None],
        };
        views.into_iter().flatten()
    }

    /// The one of them that a point is in.
    pub fn view_at(&self, place: Rect, at: Pos2) -> (Rect, f64) {
        let mut views = self.views(place);
        let first = views.next().unwrap_or((place, 0.0));
        views.find(|(half, _)| at.x >= half.left()).unwrap_or(first)
    }
}

/// A look by one eye.
pub fn by_eye(look: &Look, eye: usize) -> Look {
    Look {
        camera: Camera {
            aside: look.show.stereo.aside()[eye],
            ..look.camera
        },
        show: Show {
            stereo: Stereo::default(),
            ..look.show
        },
        ..*look
    }
}

/// Puts the pictures of both eyes into one.
#[derive(Default)]
pub struct Eyes {
    /// For one beside the other, for the left one and for the right one of those over one another; made when they are needed first.
    layers: Option<[Layer; 3]>,
    /// Whole and rough pictures.
    both: [Option<Both>; 2],
}

/// A picture of both.
struct Both {
    picture: wgpu::Texture,
    /// What it shows, and of which scene.
    of: (Look, u64),
    /// How many eyes' pictures are in it.
    eyes: usize,
}

impl Eyes {
    /// As [`Canvas::draw`]. Of whole pictures of two eyes nothing is shown before they are done.
    pub fn draw(&mut self, canvas: &mut Canvas, look: &Look, size: [u32; 2], is_rough: bool) -> Drawn {
        let pair = look.show.stereo.pair;
        if pair == Pair::Off {
            self.both = [None, None];
            return canvas.draw(look, size, is_rough);
        }
        let size = size.map(|n| n.clamp(2, canvas.most_pixels()));
        let of = (*look, canvas.changes);
        let mut both = match self.both[usize::from(is_rough)].take() {
            Some(both) if [both.picture.width(), both.picture.height()] == size => both,
            _ => Both {
                picture: picture(&canvas.device, size),
                of,
                eyes: 0,
            },
        };
        if both.of != of {
            (both.of, both.eyes) = (of, 0);
        }
        let mut is_done = true;
        while both.eyes < 2 {
            let of_eye = match pair {
                Pair::Beside => [size[0] / 2, size[1]],
                _ => size,
            };
            let drawn = canvas.draw(&by_eye(look, both.eyes), of_eye, is_rough);
            is_done &= drawn.is_done;
            if !is_done && !is_rough {
                break;
            }
            self.lay(canvas, &both, &drawn.picture);
            both.eyes += 1;
        }
        let drawn = Drawn {
            picture: both.picture.clone(),
            rows: if both.eyes == 2 { 1.0 } else { 0.0 },
            is_done,
        };
        if !is_done && is_rough {
            // There is more to come.
            both.eyes = 0;
        }
        self.both[usize::from(is_rough)] = Some(both);
        drawn
    }

    /// Puts the picture of the next eye where it belongs.
    fn lay(&mut self, canvas: &Canvas, both: &Both, picture: &wgpu::Texture) {
        use wgpu::ColorWrites as Colors;
        let device = &canvas.device;
        let layers = self.layers.get_or_insert_with(|| {
            [
                Colors::ALL,
                Colors::RED | Colors::ALPHA,
                Colors::GREEN | Colors::BLUE,
            ]
            .map(|colors| Layer::of(device, BYTES, colors))
        });
        let (layer, left) = match both.of.0.show.stereo.pair {
            Pair::Beside => (0, both.eyes as u32 * (both.picture.width() - picture.width())),
            _ => (1 + both.eyes, 0),
        };
        let laid = layers[layer].laid(device, picture);
        let view = both.picture.create_view(&wgpu::TextureViewDescriptor {
            format: Some(BYTES),
            ..wgpu::TextureViewDescriptor::default()
        });
        let mut encoder = device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        {
            let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
                label: Some("eyes"),
                color_attachments: &[Some(wgpu::RenderPassColorAttachment {
                    view: &view,
                    depth_slice: None,
                    resolve_target: None,
                    ops: wgpu::Operations {
                        load: match both.eyes {
                            0 => wgpu::LoadOp::Clear(wgpu::Color::BLACK),
                            _ => wgpu::LoadOp::Load,
                        },
                        store: wgpu::StoreOp::Store,
                    },
                })],
                ..wgpu::RenderPassDescriptor::default()
            });
            let [x, wide, high] = [left, picture.width(), picture.height()].map(|n| n as f32);
            pass.set_viewport(x, 0.0, wide, high, 0.0, 1.0);
            laid.draw(&mut pass);
        }
        canvas.queue.submit([encoder.finish()]);
    }
}

fn picture(device: &wgpu::Device, size: [u32; 2]) -> wgpu::Texture {
    device.create_texture(&wgpu::TextureDescriptor {
        label: Some("eyes"),
        size: wgpu::Extent3d {
            width: size[0],
            height: size[1],
            depth_or_array_layers: 1,
        },
        mip_level_count: 1,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format: COLOR,
        usage: wgpu::TextureUsages::RENDER_ATTACHMENT
            | wgpu::TextureUsages::TEXTURE_BINDING
            | wgpu::TextureUsages::COPY_SRC,
        view_formats: &[BYTES],
    })
}
