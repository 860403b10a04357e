// Surfaces of solids in the light of a sun from the upper left behind the viewer and of a sky that is brighter above, as
// `isoclay picture` draws them; a cut and its inside; paint; and the paper behind all.

struct Scene {
  clip_from_world: mat4x4<f32>,
  // To the right, up and to the eye; a fourth number without meaning.
  axes: mat4x4<f32>,
  // A point of the clipping plane and, in the last number of the next one, whether there is one.
  cut_at: vec4<f32>,
  cut_normal: vec4<f32>,
  // What paint is: nothing, stiffness, a share of a scale; how many lights the sky has; the radius that their maps show; nothing.
  shows: vec4<f32>,
  // Linear light of the paper, above and below.
  paper: array<vec4<f32>, 2>,
  // Pixels across and down; width of a line; length of a pixel at the centre.
  picture: vec4<f32>,
  // Densities that are black and white; nothing.
  density: vec4<f32>,
  world_from_clip: mat4x4<f32>,
};

// The sun comes after the most lights that the sky can have.
const SUN: u32 = 64u;

// Of each light the clip space of its map, and the way to it.
struct Lights {
  map_from_world: array<mat4x4<f32>, 65>,
  way: array<vec4<f32>, 65>,
};

@group(0) @binding(0) var<uniform> scene: Scene;
@group(0) @binding(1) var<uniform> lights: Lights;
// Of every second pixel of a picture, across and down: how far its surface is, as bits, and what reaches it of the sky and of the sun.
@group(1) @binding(0) var light_there: texture_2d<u32>;
// Depths of what each light sees, where the light is not known yet.
@group(1) @binding(0) var sky: texture_depth_2d_array;
@group(1) @binding(1) var sun: texture_depth_2d;

struct Corner {
  @location(0) at: vec3<f32>,
  @location(1) normal: vec3<f32>,
  @location(2) ridge: f32,
  @location(3) paint: f32,
};

// In fours, with the paint beside the normal: processors that stand in for graphics cards take time for each four that a colour asks for, as
// long as for small triangles themselves.
struct Seen {
  @builtin(position) clip: vec4<f32>,
  @location(0) normal_paint: vec4<f32>,
  @location(1) at_ridge: vec4<f32>,
};

fn seen(in: Corner) -> Seen {
  var out: Seen;
  out.clip = scene.clip_from_world * vec4(in.at, 1.0);
  out.normal_paint = vec4(in.normal, in.paint);
  out.at_ridge = vec4(in.at, in.ridge);
  return out;
}

@vertex
fn corner(in: Corner) -> Seen {
  return seen(in);
}

// A little farther away: coarser triangles of the inside do not come through the outside.
@vertex
fn corner_inside(in: Corner) -> Seen {
  var out = seen(in);
  out.clip = scene.clip_from_world * vec4(in.at - 0.02 * scene.shows.z * scene.axes[2].xyz, 1.0);
  return out;
}

// As a light sees it.
@vertex
fn lit(in: Corner, @builtin(instance_index) light: u32) -> @builtin(position) vec4<f32> {
  return lights.map_from_world[light] * vec4(in.at, 1.0);
}

// Linear light of clay, of the inside that a cut shows, and of stiff and of soft paint: blue and orange tell apart to all eyes.
const CLAY = vec3(0.612, 0.279, 0.148);
const INSIDE = vec3(0.30, 0.10, 0.07);
const STIFF = vec3(0.05, 0.20, 0.55);
const SOFT = vec3(0.80, 0.42, 0.05);
// What a cut through the clay shows: dark where it is thin, light where it is dense.
const THIN = vec3(0.045, 0.04, 0.04);
const DENSE = vec3(0.86, 0.80, 0.70);

// Where a place some pixels off the surface is in a map of so many pixels a side: column, row, depth.
fn in_map(light: u32, at: vec3<f32>, n: vec3<f32>, pixels: f32, side: u32) -> vec3<f32> {
  let pixel = 2.0 * scene.shows.z / f32(side);
  let q = lights.map_from_world[light] * vec4(at + n * (pixels * pixel), 1.0);
  return vec3((vec2(q.x, -q.y) * 0.5 + 0.5) * f32(side), q.z);
}

// Share of the sky's light that reaches a place.
fn from_sky(at: vec3<f32>, n: vec3<f32>) -> f32 {
  let count = u32(scene.shows.y);
  let side = textureDimensions(sky).x;
  var light = 0.0;
  var all = 1e-6;
  for (var i = 0u; i < count; i += 1u) {
    let weight = dot(n, lights.way[i].xyz);
    if (weight > 0.0) {
      let own = weight * (0.55 + 0.45 * dot(lights.way[i].xyz, scene.axes[1].xyz));
      all += own;
      let q = in_map(i, at, n, 2.5, side);
      if (q.z <= textureLoad(sky, vec2<i32>(q.xy), i32(i), 0)) {
        light += own;
      }
    }
  }
  return light / all;
}

// Share of the sun that reaches a place: soft at the rim of its shadows.
fn from_sun(at: vec3<f32>, n: vec3<f32>) -> f32 {
  let q = in_map(SUN, at, n, 5.0, textureDimensions(sun).x);
  var seen = 0.0;
  for (var i = -2; i <= 2; i += 1) {
    for (var j = -2; j <= 2; j += 1) {
      seen += select(0.0, 1.0, q.z <= textureLoad(sun, vec2<i32>(q.xy) + vec2(i, j), 0));
    }
  }
  return seen / 25.0;
}

// What painted stiffness makes of clay.
fn painted(paint: f32) -> vec3<f32> {
  let share = clamp(paint / 4.0, -1.0, 1.0);
  return mix(CLAY, select(SOFT, STIFF, share > 0.0), sqrt(abs(share)) * 0.85);
}

// Colour of the inside of a solid, where that is open or cut.
fn inside(n: vec3<f32>) -> vec4<f32> {
  return vec4(INSIDE * (0.55 + 0.3 * abs(dot(normalize(n), scene.axes[2].xyz))), 1.0);
}

// Colour of a place in a light, as the cut has it.
fn colored(in: Seen, is_front: bool, color: vec3<f32>, light: f32) -> vec4<f32> {
  if (!is_front) {
    return inside(in.normal_paint.xyz);
  }
  return vec4(color * light, 1.0);
}

fn clay_or_paint(paint: f32) -> vec3<f32> {
  if (scene.shows.x > 0.5) {
    return painted(paint);
  }
  return CLAY;
}

fn is_cut(at: vec3<f32>) -> bool {
  return scene.cut_normal.w > 0.5 && dot(at - scene.cut_at.xyz, scene.cut_normal.xyz) > 0.0;
}

// All of the sky's light.
fn all_sky(n: vec3<f32>) -> f32 {
  return 0.55 + 0.30 * dot(n, scene.axes[1].xyz);
}

// The light that reaches a place: as in the four pixels round it, those above all whose surface is as far away.
fn light_at(in: Seen) -> f32 {
  let n = normalize(in.normal_paint.xyz);
  let place = 0.5 * in.clip.xy - 0.5;
  let first = floor(place);
  let part = place - first;
  let near = fwidth(in.clip.z) + 1e-6;
  var sum = vec3(0.0);
  for (var i = 0; i < 4; i += 1) {
    let beside = vec2(i & 1, i >> 1u);
    let there = textureLoad(light_there, vec2<i32>(first) + beside, 0);
    let share = abs(1.0 - vec2<f32>(beside) - part);
    let off = abs(bitcast<f32>(there.x) - in.clip.z);
    sum += (share.x * share.y + 0.01) / (off + near) * vec3(unpack2x16unorm(there.y), 1.0);
  }
  let reaches = sum.xy / sum.z;
  let facing = max(dot(n, lights.way[SUN].xyz), 0.0);
  return 0.05 + all_sky(n) * reaches.x + 0.95 * facing * reaches.y;
}

// All of the light, darker in hollows.
fn all_light(in: Seen) -> f32 {
  let n = normalize(in.normal_paint.xyz);
  let facing = max(dot(n, lights.way[SUN].xyz), 0.0);
  let hollow = 1.0 + 0.45 * clamp(in.at_ridge.w, -1.0, 0.0);
  return 0.05 + all_sky(n) * hollow + 0.95 * facing;
}

// In the light that reaches a place. Of its own, not a branch: processors that stand in for graphics cards take both sides of those.
@fragment
fn shade_lit(in: Seen) -> @location(0) vec4<f32> {
  return vec4(clay_or_paint(in.normal_paint.w) * light_at(in), 1.0);
}

@fragment
fn shade_inside(in: Seen) -> @location(0) vec4<f32> {
  return inside(in.normal_paint.xyz);
}

// In all of the light. Of its own too: what may be discarded is coloured even where it is hidden.
@fragment
fn shade_front(in: Seen) -> @location(0) vec4<f32> {
  return vec4(clay_or_paint(in.normal_paint.w) * all_light(in), 1.0);
}

// The same, with the cut and the inside.
@fragment
fn shade(in: Seen, @builtin(front_facing) is_front: bool) -> @location(0) vec4<f32> {
  if (is_cut(in.at_ridge.xyz)) {
    discard;
  }
  return colored(in, is_front, clay_or_paint(in.normal_paint.w), all_light(in));
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
  return vec4(mix(scene.paper[1].rgb, scene.paper[0].rgb, in.height), 1.0);
}

// A surface that is looked through: denser where it is seen from the side, as glass is.
const VEIL = vec3(0.42, 0.60, 0.75);

// Its light and how much of what is behind it takes, by its normal. Its inside is seen too.
fn veil_of(normal: vec3<f32>) -> vec4<f32> {
  let toward = dot(normal, scene.axes[2].xyz);
  let n = normal * select(-1.0, 1.0, toward > 0.0);
  let facing = max(dot(n, lights.way[SUN].xyz), 0.0);
  let light = 0.10 + all_sky(n) + 0.6 * facing;
  let aside = 1.0 - abs(toward);
  return vec4(VEIL * light, 0.16 + 0.5 * aside * aside);
}
