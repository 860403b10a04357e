//! Where the eye is.

// Clip space as wgpu has it: y up, z from 0 to 1.
use glam::dcamera::rh::proj::directx as project;
use glam::{DMat3, DMat4, DQuat, DVec2, DVec3, DVec4};

/// Angle of the picture's height, rad.
const ANGLE: f64 = 0.52;

/// A half line.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ray {
    /// Where it begins.
    pub from: DVec3,
    /// Of length 1.
    pub along: DVec3,
}

/// An eye that goes round a point. Places of a picture are in heights of it, from its middle to the right and up.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Camera {
    /// What it goes round.
    pub center: DVec3,
    /// Length at that point which fills the height of the picture.
    pub height: f64,
    /// Whether what is farther away looks smaller.
    pub perspective: bool,
    /// Up in the world, of length 1.
    pub up: DVec3,
    /// Angles about `up` and above the horizon, rad.
    pub turn: [f64; 2],
    /// How far the eye stands to the right, as a share of its way to what it goes round, which stays in its place in the picture.
    pub aside: f64,
}

impl Camera {
    /// Looks at a ball from the front and a little above.
    pub fn onto(center: DVec3, radius: f64, up: DVec3) -> Self {
        Self {
            center,
            height: 2.3 * radius,
            perspective: true,
            up,
            turn: [0.35, 0.25],
            aside: 0.0,
        }
    }

    /// Looks at a place from far away along a line to the eye, with up as near to upright as that allows.
    pub fn along(center: DVec3, height: f64, toward_eye: DVec3, up: DVec3) -> Self {
        let up = up.normalize();
        let mut camera = Self {
            center,
            height,
            perspective: false,
            up,
            turn: [0.0; 2],
            aside: 0.0,
        };
        let [right, _, front] = camera.axes();
        let toward_eye = toward_eye.normalize();
        camera.turn = [
            toward_eye.dot(right).atan2(toward_eye.dot(front)),
            toward_eye.dot(up).clamp(-1.0, 1.0).asin(),
        ];
        camera
    }

    /// To the right, up and to the eye, of length 1.
    pub fn axes(&self) -> [DVec3; 3] {
        // Whatever is up: towards the viewer is -y where that is z, else z.
        let front = if self.up.z.abs() > 0.9 {
            -DVec3::Y
        } else {
            DVec3::Z
        };
        let right = self.up.cross(front).normalize();
        let front = right.cross(self.up);
        let around = DQuat::from_axis_angle(self.up, self.turn[0]);
        let right = around * right;
        let above = DQuat::from_axis_angle(right, -self.turn[1]);
        [right, above * self.up, above * (around * front)]
    }

    /// From what it goes round to the eye, 1 long towards it.
    pub fn toward_eye(&self) -> DVec3 {
        let [right, _, back] = self.axes();
        back + self.aside * right
    }

    /// From the eye to what it goes round, straight ahead.
    pub fn distance(&self) -> f64 {
        0.5 * self.height / (0.5 * ANGLE).tan()
    }

    /// The line under a place of the picture, from the eye.
    pub fn ray(&self, at: DVec2) -> Ray {
        let [right, up, _] = self.axes();
        let on_plane = self.center + self.height * (at.x * right + at.y * up);
        let eye = self.center + self.distance() * self.toward_eye();
        match self.perspective {
            true => Ray {
                from: eye,
                along: (on_plane - eye).normalize(),
            },
            // From so far away that all that is seen lies before it.
            false => Ray {
                from: on_plane + 1e3 * self.height * self.toward_eye(),
                along: -self.toward_eye().normalize(),
            },
        }
    }

    /// Where a point is in the picture.
    pub fn place(&self, p: DVec3) -> DVec2 {
        let [right, up, back] = self.axes();
        let way = p - self.center;
        let size = match self.perspective {
            true => self.height * (1.0 - way.dot(back) / self.distance()),
            false => self.height,
        };
        DVec2::new(way.dot(right) - self.aside * way.dot(back), way.dot(up)) / size
    }

    /// Clip space from a world whose origin is at `origin`, for things within `radius` of the centre.
    pub fn clip_from_world(&self, origin: DVec3, radius: f64, aspect: f64) -> DMat4 {
        let [right, up, back] = self.axes();
        let turn = DMat3::from_cols(right, up, back).transpose();
        let distance = self.distance();
        let center = turn * (origin - self.center) - DVec3::new(0.0, 0.0, distance);
        let view = DMat4::from_cols(
            turn.x_axis.extend(0.0),
            turn.y_axis.extend(0.0),
            turn.z_axis.extend(0.0),
            center.extend(1.0),
        );
        let (near, far) = ((distance - radius).max(1e-3 * distance), distance + radius);
        let seen = match self.perspective {
            true => project::perspective(ANGLE, aspect, near, far),
            false => {
                let (h, w) = (0.5 * self.height, 0.5 * self.height * aspect);
                project::orthographic(-w, w, -h, h, distance - radius, far)
            }
        };
        // What is seen from aside is seen from ahead when it leans, about the plane of what the eye goes round.
        let lean = DMat4::from_cols(
            DVec4::X,
            DVec4::Y,
            DVec4::new(-self.aside, 0.0, 1.0, 0.0),
            DVec4::new(-self.aside * distance, 0.0, 0.0, 1.0),
        );
        match self.aside == 0.0 {
            true => seen * view,
            false => seen * lean * view,
        }
    }

    /// Turns round the centre by a way over the picture, half a turn for its whole height.
    pub fn orbit(&mut self, way: DVec2) {
        use std::f64::consts::{FRAC_PI_2, PI};
        self.turn[0] -= PI * way.x;
        self.turn[1] = (self.turn[1] - PI * way.y).clamp(-FRAC_PI_2, FRAC_PI_2);
    }

    /// Goes along, so that what lies at the centre's depth follows a way over the picture.
    pub fn pan(&mut self, way: DVec2) {
        let [right, up, _] = self.axes();
        self.center -= self.height * (way.x * right + way.y * up);
    }

    /// Comes nearer, by a factor below 1, with the place under `at` staying there.
    pub fn zoom(&mut self, factor: f64, at: DVec2) {
        self.pan(-at);
        self.height *= factor;
        self.pan(at);
    }

    /// Looks along an axis of the world, from its positive end.
    pub fn look_from(&mut self, axis: DVec3) {
        let mut level = *self;
        level.turn = [0.0, 0.0];
        let [right, up, front] = level.axes();
        let sideways = DVec2::new(axis.dot(right), axis.dot(front));
        self.turn = match sideways.length() > 0.5 {
            true => [sideways.x.atan2(sideways.y), 0.0],
            false => [0.0, axis.dot(up).signum() * std::f64::consts::FRAC_PI_2],
        };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Where a point is in clip space, after the division.
    fn seen(clip: DMat4, p: DVec3) -> DVec3 {
        let q = clip * p.extend(1.0);
        q.truncate() / q.w
    }

    fn cameras() -> impl Iterator<Item = Camera> {
        let kinds = [(true, 0.0), (false, 0.0), (true, 0.05), (false, -0.05)];
        [DVec3::Y, DVec3::Z].into_iter().flat_map(move |up| {
            kinds.map(|(perspective, aside)| Camera {
                perspective,
                aside,
                ..Camera::onto(DVec3::new(3.0, -2.0, 5.0), 4.0, up)
            })
        })
    }

    /// The line under a place goes through all points that are drawn there, and the graphics card draws them there.
    #[test]
    fn lines_places_and_pictures_agree() {
        for camera in cameras() {
            for at in [DVec2::ZERO, DVec2::new(0.3, -0.4), DVec2::new(-0.7, 0.1)] {
                let ray = camera.ray(at);
                for beyond in [-1.5, 0.0, 2.0] {
                    let far = (camera.center - ray.from).dot(ray.along) + beyond;
                    let p = ray.from + far * ray.along;
                    assert!((camera.place(p) - at).length() < 1e-9);
                    let origin = DVec3::new(1.0, 1.0, 1.0);
                    let clip = camera.clip_from_world(origin, 8.0, 1.5);
                    let q = seen(clip, p - origin);
                    let drawn = DVec2::new(0.5 * 1.5 * q.x, 0.5 * q.y);
                    assert!((drawn - at).length() < 1e-6, "{drawn} for {at}");
                    assert!((0.0..=1.0).contains(&q.z));
                }
            }
        }
    }

    #[test]
    fn zoom_keeps_what_is_under_the_mouse() {
        for mut camera in cameras() {
            let at = DVec2::new(0.3, 0.2);
            let [right, up, _] = camera.axes();
            let p = camera.center + camera.height * (at.x * right + at.y * up);
            camera.zoom(0.5, at);
            assert!((camera.place(p) - at).length() < 1e-9);
        }
    }

    #[test]
    fn views_along_a_line_look_along_it() {
        for up in [
            DVec3::X,
            DVec3::Y,
            DVec3::Z,
            DVec3::new(0.3, 0.8, -0.2).normalize(),
        ] {
            for aside in [DVec3::new(0.2, -0.5, 0.9), DVec3::new(-0.7, 0.4, -0.1)] {
                let back = aside.reject_from(up).normalize();
                let camera = Camera::along(DVec3::ONE, 2.0, back, up);
                let [right, above, toward] = camera.axes();
                assert!((toward - back).length() < 1e-9 && (above - up).length() < 1e-9);
                assert!((right - up.cross(back)).length() < 1e-9);
            }
        }
    }

    #[test]
    fn standard_views_look_along_the_axes() {
        for mut camera in cameras() {
            for axis in DVec3::AXES.into_iter().flat_map(|a| [a, -a]) {
                camera.look_from(axis);
                assert!(
                    (camera.axes()[2] - axis).length() < 1e-9,
                    "{axis} with {} up",
                    camera.up
                );
            }
        }
    }
}
