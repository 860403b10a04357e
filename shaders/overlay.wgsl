// What is drawn besides surfaces, after surface.wgsl, which stands before this: lines and dots, a surface that is looked through, the density
// on the cut, colours that tell shares of a scale, and paint without light.

// Of places that no share is known of.
const UNKNOWN = vec3(0.32);
// The scale viridis [Smith15], as the screen has it: the entries of `crates/app/src/check/color.rs`.
const SCALE = array<vec3<f32>, 9>(
  vec3(0.267, 0.004, 0.329), vec3(0.278, 0.173, 0.478), vec3(0.231, 0.318, 0.545),
  vec3(0.173, 0.443, 0.557), vec3(0.129, 0.565, 0.553), vec3(0.153, 0.678, 0.506),
  vec3(0.361, 0.784, 0.388), vec3(0.667, 0.863, 0.196), vec3(0.992, 0.906, 0.145),
);

// Linear light of what the screen has.
fn linear(color: vec3<f32>) -> vec3<f32> {
  return select(pow((color + 0.055) / 1.055, vec3(2.4)), color / 12.92, color <= vec3(0.04045));
}

// Colour of a share of the scale.
fn of_scale(share: f32) -> vec3<f32> {
  let at = clamp(share, 0.0, 1.0) * 8.0;
  let n = min(u32(at), 7u);
  var scale = SCALE;
  let color = linear(mix(scale[n], scale[n + 1u], at - f32(n)));
  return select(color, UNKNOWN, share < 0.0);
}

// Surfaces whose colours tell shares of a scale in place of paint.
@fragment
fn shade_scale_lit(in: Seen) -> @location(0) vec4<f32> {
  return vec4(of_scale(in.normal_paint.w) * light_at(in), 1.0);
}

@fragment
fn shade_scale_front(in: Seen) -> @location(0) vec4<f32> {
  return vec4(of_scale(in.normal_paint.w) * all_light(in), 1.0);
}

@fragment
fn shade_scale(in: Seen, @builtin(front_facing) is_front: bool) -> @location(0) vec4<f32> {
  if (is_cut(in.at_ridge.xyz)) {
    discard;
  }
  return colored(in, is_front, of_scale(in.normal_paint.w), all_light(in));
}

// A line, or a dot where both ends are one; its colour as the screen has it.
struct Stretch {
  @location(0) start: vec3<f32>,
  @location(1) end: vec3<f32>,
  @location(2) color: vec4<f32>,
};

struct Inked {
  @builtin(position) clip: vec4<f32>,
  @location(0) at: vec3<f32>,
  @location(1) color: vec4<f32>,
};

// Sides of a dot, in widths of a line.
const DOT: f32 = 2.2;
// Pixels by which lines stand before the surface that they lie on.
const BEFORE: f32 = 1.5;

fn in_clip(at: vec3<f32>) -> vec4<f32> {
  return scene.clip_from_world * vec4(at + scene.axes[2].xyz * (BEFORE * scene.picture.w), 1.0);
}

// Two triangles of six corners along a line: as wide everywhere in the picture, however far away.
@vertex
fn ink(@builtin(vertex_index) n: u32, in: Stretch) -> Inked {
  let a = in_clip(in.start);
  let b = in_clip(in.end);
  var out: Inked;
  out.color = vec4(linear(in.color.rgb), in.color.a);
  // Behind the eye.
  if (a.z < 0.0 && b.z < 0.0) {
    out.clip = vec4(2.0, 2.0, 2.0, 1.0);
    return out;
  }
  var ends = array<vec4<f32>, 2>(a, b);
  if (a.z < 0.0) {
    ends[0] = mix(a, b, a.z / (a.z - b.z));
  } else if (b.z < 0.0) {
    ends[1] = mix(b, a, b.z / (b.z - a.z));
  }
  let half = 0.5 * scene.picture.xy;
  let way = (ends[1].xy / ends[1].w - ends[0].xy / ends[0].w) * half;
  let is_dot = all(in.start == in.end);
  let along = select(way / max(length(way), 1e-6), vec2(1.0, 0.0), is_dot || length(way) < 1e-3);
  let reach = 0.5 * scene.picture.z * select(1.0, DOT, is_dot);
  var corners = array<u32, 6>(0u, 1u, 2u, 2u, 1u, 3u);
  let corner = corners[n];
  let is_end = corner > 1u;
  let end = ends[corner >> 1u];
  let side = select(-1.0, 1.0, (corner & 1u) == 1u);
  let aside = (along * select(-1.0, 1.0, is_end) + vec2(-along.y, along.x) * side) * reach;
  out.clip = vec4(end.xy + aside / half * end.w, end.zw);
  out.at = select(in.start, in.end, is_end);
  return out;
}

@fragment
fn ink_color(in: Inked) -> @location(0) vec4<f32> {
  if (is_cut(in.at)) {
    discard;
  }
  return in.color;
}

@fragment
fn veil(in: Seen) -> @location(0) vec4<f32> {
  if (is_cut(in.at_ridge.xyz)) {
    discard;
  }
  return veil_of(normalize(in.normal_paint.xyz));
}

// Paint without light.
@fragment
fn paint_alone(in: Seen) -> @location(0) vec4<f32> {
  if (is_cut(in.at_ridge.xyz)) {
    discard;
  }
  return vec4(select(painted(in.normal_paint.w), of_scale(in.normal_paint.w), scene.shows.x > 1.5), 1.0);
}

// A sheet of the clipping plane through a solid.
struct Cap {
  // Its first node in the world, and the ways to the next in a row and to the next row.
  corner: vec4<f32>,
  right: vec4<f32>,
  down: vec4<f32>,
  // Nodes in a row; rows; density of the surface; nothing.
  size: vec4<f32>,
};

@group(1) @binding(2) var<uniform> cap: Cap;
@group(1) @binding(3) var densities: texture_2d<f32>;

struct OnCap {
  @builtin(position) clip: vec4<f32>,
  @location(0) node: vec2<f32>,
};

@vertex
fn cap_corner(@builtin(vertex_index) n: u32) -> OnCap {
  var corners = array<u32, 6>(0u, 1u, 2u, 2u, 1u, 3u);
  let corner = corners[n];
  var out: OnCap;
  out.node = vec2(f32(corner & 1u), f32(corner >> 1u)) * (cap.size.xy - 1.0);
  let at = cap.corner.xyz + out.node.x * cap.right.xyz + out.node.y * cap.down.xyz;
  out.clip = scene.clip_from_world * vec4(at, 1.0);
  return out;
}

@fragment
fn cap_color(in: OnCap) -> @location(0) vec4<f32> {
  let low = clamp(floor(in.node), vec2(0.0), cap.size.xy - 2.0);
  let t = in.node - low;
  let n = vec2<i32>(low);
  let above = mix(textureLoad(densities, n, 0).x, textureLoad(densities, n + vec2(1, 0), 0).x, t.x);
  let below = mix(textureLoad(densities, n + vec2(0, 1), 0).x, textureLoad(densities, n + 1, 0).x, t.x);
  let f = mix(above, below, t.y);
  if (f <= cap.size.z) {
    discard;
  }
  let share = clamp((f - scene.density.x) / max(scene.density.y - scene.density.x, 1e-30), 0.0, 1.0);
  return vec4(mix(THIN, DENSE, share * share), 1.0);
}
