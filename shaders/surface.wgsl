// Surfaces of solids: a bright sun from the upper left behind the viewer, a sky that is brighter above, darker hollows, paint.

struct Scene {
  clip_from_world: mat4x4<f32>,
  // To the right, up and to the eye; a fourth number without meaning.
  axes: mat4x4<f32>,
  // A point of the clipping plane and, in the last number of the next one, whether there is one.
  cut_at: vec4<f32>,
  cut_normal: vec4<f32>,
  // Whether paint is shown; three numbers without meaning.
  shows: vec4<f32>,
};

@group(0) @binding(0) var<uniform> scene: Scene;

struct Corner {
  @location(0) at: vec3<f32>,
  @location(1) normal: vec3<f32>,
  @location(2) ridge: f32,
  @location(3) paint: f32,
};

struct Seen {
  @builtin(position) clip: vec4<f32>,
  @location(0) at: vec3<f32>,
  @location(1) normal: vec3<f32>,
  @location(2) ridge: f32,
  @location(3) paint: f32,
};

@vertex
fn corner(in: Corner) -> Seen {
  var out: Seen;
  out.clip = scene.clip_from_world * vec4(in.at, 1.0);
  out.at = in.at;
  out.normal = in.normal;
  out.ridge = in.ridge;
  out.paint = in.paint;
  return out;
}

// Linear light of clay, of the inside that a cut shows, and of stiff and of soft paint: blue and orange tell apart to all eyes.
const CLAY = vec3(0.60, 0.275, 0.148);
const INSIDE = vec3(0.30, 0.10, 0.07);
const STIFF = vec3(0.05, 0.20, 0.55);
const SOFT = vec3(0.80, 0.42, 0.05);
const SUN = vec3(-0.45, 0.65, 0.62);

@fragment
fn shade(in: Seen, @builtin(front_facing) is_front: bool) -> @location(0) vec4<f32> {
  if (scene.cut_normal.w > 0.5 && dot(in.at - scene.cut_at.xyz, scene.cut_normal.xyz) > 0.0) {
    discard;
  }
  let n = normalize(in.normal);
  // In the axes of the eye.
  let v = vec3(dot(n, scene.axes[0].xyz), dot(n, scene.axes[1].xyz), dot(n, scene.axes[2].xyz));
  if (!is_front) {
    return vec4(INSIDE * (0.55 + 0.3 * abs(v.z)), 1.0);
  }
  var color = CLAY;
  if (scene.shows.x > 0.5) {
    let share = clamp(in.paint / 4.0, -1.0, 1.0);
    color = mix(color, select(SOFT, STIFF, share > 0.0), sqrt(abs(share)) * 0.85);
  }
  let sun = max(dot(v, normalize(SUN)), 0.0);
  let sky = 0.5 + 0.5 * v.y;
  let hollow = 1.0 + 0.45 * clamp(in.ridge, -1.0, 1.0);
  let halfway = normalize(normalize(SUN) + vec3(0.0, 0.0, 1.0));
  let shine = pow(max(dot(v, halfway), 0.0), 40.0) * 0.10;
  let rim = pow(1.0 - clamp(v.z, 0.0, 1.0), 3.0) * 0.12;
  let light = 0.95 * sun + 0.36 * sky + 0.10;
  return vec4(color * light * hollow + shine + rim * vec3(0.7, 0.8, 1.0), 1.0);
}

struct Paper {
  @builtin(position) clip: vec4<f32>,
  @location(0) height: f32,
};

// One triangle over the whole picture, behind all.
@vertex
fn paper(@builtin(vertex_index) n: u32) -> Paper {
  var out: Paper;
  let at = vec2(f32((n << 1u) & 2u), f32(n & 2u)) * 2.0 - 1.0;
  out.clip = vec4(at, 1.0, 1.0);
  out.height = 0.5 + 0.5 * at.y;
  return out;
}

@fragment
fn paper_color(in: Paper) -> @location(0) vec4<f32> {
  return vec4(mix(vec3(0.035, 0.038, 0.045), vec3(0.10, 0.11, 0.125), in.height), 1.0);
}
