// Lines from the eye to the surface of splines, and through their density; in the light of surface.wgsl, which stands before this.

struct Eye {
  // Where a line begins, and its way: of the middle of the picture, and what is added to the right and up, as far as its edges.
  start: array<vec4<f32>, 3>,
  way: array<vec4<f32>, 3>,
  // Pixels across and down; solids; radius of a ball round the origin that holds all.
  picture: vec4<f32>,
  // Densities that are black and white; share of the light that white takes over a length, as an exponent; length of a step in cells.
  density: vec4<f32>,
};

struct Solid {
  lattice_from_world: mat4x4<f32>,
  // Cells of level 0, and the length by which hollows are told.
  cells: vec4<f32>,
  // Its root, as many cells wide; the density of its surface; a length that is next to nothing.
  root: u32,
  width: f32,
  iso: f32,
  little: f32,
};

// A cube of a tree, with what is drawn of each of its octants `4x + 2y + z`: another node, or the numbers of its own brick, or nothing
// because all of the octant is on one side.
struct Node {
  octants: array<u32, 8>,
  brick: u32,
  low: f32,
  high: f32,
  room: u32,
};
const OWN: u32 = 0xffffffffu;
const OUTSIDE: u32 = 0xfffffffeu;
const INSIDE_ALL: u32 = 0xfffffffdu;

// Coefficients along an edge of a brick, and cells.
const HALO: u32 = 11u;
const CELLS: f32 = 8.0;
// After these the ranges of its blocks of 2 cells a side, each in one number, as shares of the range of the brick, which comes last.
const RANGES: u32 = 1331u;
const LEAST: u32 = 1395u;
const SPAN: u32 = 1396u;
const BRICK: u32 = 1397u;

@group(2) @binding(0) var<uniform> eye: Eye;
@group(2) @binding(1) var<storage, read> solids: array<Solid>;
@group(2) @binding(2) var<storage, read> nodes: array<Node>;
@group(2) @binding(3) var<storage, read> bricks: array<u32>;
// What is behind, and how far away; what a first look found.
@group(3) @binding(0) var ground: texture_2d<f32>;
@group(3) @binding(1) var ground_depth: texture_depth_2d;
@group(3) @binding(2) var before: texture_2d<f32>;

// Cubic B-splines on a cell, and their derivatives.
fn weights(t: f32) -> vec4<f32> {
  let s = 1.0 - t;
  let inner = 1.0 + 3.0 * (vec2(s, t) + vec2(s, t) * vec2(s, t) * (1.0 - vec2(s, t)));
  return vec4(s * s * s, inner, t * t * t) / 6.0;
}

fn slopes(t: f32) -> vec4<f32> {
  let s = 1.0 - t;
  let inner = 0.5 + vec2(s, t) - 1.5 * vec2(s * s, t * t);
  return vec4(-0.5 * s * s, -inner.x, inner.y, 0.5 * t * t);
}

fn bends(t: f32) -> vec4<f32> {
  let s = 1.0 - t;
  return vec4(s, 1.0 - 3.0 * s, 1.0 - 3.0 * t, t);
}

fn row(at: u32) -> vec4<f32> {
  return bitcast<vec4<f32>>(vec4(bricks[at], bricks[at + 1u], bricks[at + 2u], bricks[at + 3u]));
}

fn plane(at: u32, y: vec4<f32>, z: vec4<f32>) -> f32 {
  return dot(y, vec4(dot(z, row(at)), dot(z, row(at + HALO)), dot(z, row(at + 2u * HALO)), dot(z, row(at + 3u * HALO))));
}

// The cell of a brick in which a place of it lies, 0 to 8 along each axis, and where in that.
fn cell_of(c: vec3<f32>) -> vec3<f32> {
  return clamp(floor(c), vec3(0.0), vec3(CELLS - 1.0));
}

fn first_of(brick: u32, cell: vec3<f32>) -> u32 {
  let k = vec3<u32>(cell);
  return brick * BRICK + (k.x * HALO + k.y) * HALO + k.z;
}

fn weighed(at: u32, x: vec4<f32>, y: vec4<f32>, z: vec4<f32>) -> f32 {
  let step = HALO * HALO;
  return dot(x, vec4(plane(at, y, z), plane(at + step, y, z), plane(at + 2u * step, y, z), plane(at + 3u * step, y, z)));
}

fn value(brick: u32, c: vec3<f32>) -> f32 {
  let cell = cell_of(c);
  let t = c - cell;
  return weighed(first_of(brick, cell), weights(t.x), weights(t.y), weights(t.z));
}

// By the cells of the brick.
fn gradient(brick: u32, c: vec3<f32>) -> vec3<f32> {
  let cell = cell_of(c);
  let t = c - cell;
  let at = first_of(brick, cell);
  let x = weights(t.x);
  let y = weights(t.y);
  let z = weights(t.z);
  return vec3(weighed(at, slopes(t.x), y, z), weighed(at, x, slopes(t.y), z), weighed(at, x, y, slopes(t.z)));
}

fn hessian(brick: u32, c: vec3<f32>) -> mat3x3<f32> {
  let cell = cell_of(c);
  let t = c - cell;
  let at = first_of(brick, cell);
  let x = weights(t.x);
  let y = weights(t.y);
  let z = weights(t.z);
  let dx = slopes(t.x);
  let dy = slopes(t.y);
  let dz = slopes(t.z);
  let xy = weighed(at, dx, dy, z);
  let xz = weighed(at, dx, y, dz);
  let yz = weighed(at, x, dy, dz);
  return mat3x3(
    weighed(at, bends(t.x), y, z), xy, xz,
    xy, weighed(at, x, bends(t.y), z), yz,
    xz, yz, weighed(at, x, y, bends(t.z)),
  );
}

struct Line {
  start: vec3<f32>,
  way: vec3<f32>,
};

// The line under a place of the picture, in pixels from its upper left corner; its way has length 1.
fn line_under(pixel: vec2<f32>) -> Line {
  let at = (pixel / eye.picture.xy * 2.0 - 1.0) * vec2(1.0, -1.0);
  let start = eye.start[0].xyz + at.x * eye.start[1].xyz + at.y * eye.start[2].xyz;
  let way = eye.way[0].xyz + at.x * eye.way[1].xyz + at.y * eye.way[2].xyz;
  return Line(start, normalize(way));
}

// Lengths along a line at which it goes into a box from the origin and out of it, and across which axis it goes in.
fn through(line: Line, low: vec3<f32>, high: vec3<f32>) -> vec3<f32> {
  let way = select(line.way, vec3(1e-20), abs(line.way) < vec3(1e-20));
  let a = (low - line.start) / way;
  let b = (high - line.start) / way;
  let enters = min(a, b);
  let leaves = max(a, b);
  let start = max(enters.x, max(enters.y, enters.z));
  let axis = select(select(2.0, 1.0, enters.y == start), 0.0, enters.x == start);
  return vec3(start, min(leaves.x, min(leaves.y, leaves.z)), axis);
}

// A cube on one side of the density, or a block of 2 cells a side of a brick.
struct Spot {
  low: vec3<f32>,
  size: f32,
  // Or `OUTSIDE` or `INSIDE_ALL`.
  brick: u32,
  // Where the brick begins, and its cells along one of level 0.
  corner: vec3<f32>,
  scale: f32,
};

// The largest cube round a place of a solid that need not be looked into, for the density that is looked for.
fn find(solid: u32, p: vec3<f32>, level: f32) -> Spot {
  var spot: Spot;
  var at = solids[solid].root;
  var low = vec3(0.0);
  var size = solids[solid].width;
  for (var depth = 0; depth < 40; depth += 1) {
    if (nodes[at].high <= level || nodes[at].low > level) {
      spot = Spot(low, size, select(INSIDE_ALL, OUTSIDE, nodes[at].high <= level), low, 1.0);
      return spot;
    }
    let half = 0.5 * size;
    let is_far = p >= low + half;
    let octant = 4u * u32(is_far.x) + 2u * u32(is_far.y) + u32(is_far.z);
    let next = nodes[at].octants[octant];
    let corner = select(low, low + half, is_far);
    if (next == OUTSIDE || next == INSIDE_ALL) {
      spot = Spot(corner, half, next, low, 1.0);
      return spot;
    }
    if (next == OWN) {
      let brick = nodes[at].brick;
      let scale = CELLS / size;
      let block = clamp(floor((p - low) * (0.5 * scale)), vec3(0.0), vec3(3.0));
      let k = vec3<u32>(block);
      let share = unpack2x16unorm(bricks[brick * BRICK + RANGES + 16u * k.x + 4u * k.y + k.z]);
      let ends = bitcast<f32>(bricks[brick * BRICK + LEAST]) + share * bitcast<f32>(bricks[brick * BRICK + SPAN]);
      spot = Spot(low + block * (2.0 / scale), 2.0 / scale, brick, low, scale);
      if (ends.y <= level) {
        spot.brick = OUTSIDE;
      } else if (ends.x > level) {
        spot.brick = INSIDE_ALL;
      }
      return spot;
    }
    at = next;
    low = corner;
    size = half;
  }
  spot = Spot(low, size, OUTSIDE, low, 1.0);
  return spot;
}

// The brick round a place of a solid, whatever its density.
fn look_up(solid: u32, p: vec3<f32>) -> Spot {
  var at = solids[solid].root;
  var low = vec3(0.0);
  var size = solids[solid].width;
  for (var depth = 0; depth < 40; depth += 1) {
    let half = 0.5 * size;
    let is_far = p >= low + half;
    let next = nodes[at].octants[4u * u32(is_far.x) + 2u * u32(is_far.y) + u32(is_far.z)];
    if (next >= INSIDE_ALL) {
      let brick = select(next, nodes[at].brick, next == OWN || nodes[at].brick < INSIDE_ALL);
      return Spot(low, size, brick, low, CELLS / size);
    }
    at = next;
    low = select(low, low + half, is_far);
    size = half;
  }
  return Spot(low, size, OUTSIDE, low, 1.0);
}

fn is_brick(spot: Spot) -> bool {
  return spot.brick != OUTSIDE && spot.brick != INSIDE_ALL;
}

fn at_length(line: Line, t: f32) -> vec3<f32> {
  return line.start + t * line.way;
}

// How far the density of a block is above the surface.
fn above(spot: Spot, line: Line, t: f32, iso: f32) -> f32 {
  return value(spot.brick, (at_length(line, t) - spot.corner) * spot.scale) - iso;
}

// A line as a solid's lattice has it.
fn in_lattice(solid: u32, line: Line) -> Line {
  let map = solids[solid].lattice_from_world;
  return Line((map * vec4(line.start, 1.0)).xyz, (map * vec4(line.way, 0.0)).xyz);
}

// The part of a line before the clipping plane that lies in a solid's box, as of `through`; its axis is 3 where it begins at the plane.
fn part_of(solid: u32, line: Line) -> vec3<f32> {
  var part = through(in_lattice(solid, line), vec3(0.0), solids[solid].cells.xyz);
  part.x = max(part.x, 0.0);
  if (scene.cut_normal.w > 0.5) {
    let fall = dot(line.way, scene.cut_normal.xyz);
    let far = dot(scene.cut_at.xyz - line.start, scene.cut_normal.xyz) / select(fall, 1e-20, abs(fall) < 1e-20);
    if (fall >= 0.0) {
      part.y = min(part.y, far);
    } else if (far > part.x) {
      part = vec3(far, part.y, 3.0);
    }
  }
  return part;
}

// Where a line meets solids first: which of them, how far away, and how it goes in: through the surface, or as of `part_of`.
struct Hit {
  t: f32,
  solid: u32,
  by: u32,
};
const NOTHING: u32 = 0xffffffffu;
const BY_SURFACE: u32 = 4u;

// Cells from one look at the density to the next, most cubes on a line, and most steps to the surface once it is passed.
const STEP: f32 = 0.5;
const MOST: i32 = 1000;
const NEARER: i32 = 8;

// Where the density between two lengths rises through that of the surface: regula falsi as the Illinois rule has it [Dowell71].
fn crossing(spot: Spot, line: Line, iso: f32, outside: vec2<f32>, inside: vec2<f32>) -> f32 {
  var a = outside;
  var b = inside;
  var side = 0;
  for (var n = 0; n < NEARER; n += 1) {
    let t = clamp((a.x * b.y - b.x * a.y) / (b.y - a.y), a.x, b.x);
    let f = above(spot, line, t, iso);
    if (abs(f) < 1e-6 * max(abs(iso), inside.y - outside.y)) {
      return t;
    }
    if (f > 0.0) {
      b = vec2(t, f);
      a.y *= select(1.0, 0.5, side == 1);
      side = 1;
    } else {
      a = vec2(t, f);
      b.y *= select(1.0, 0.5, side == -1);
      side = -1;
    }
  }
  return b.x;
}

// The first way into one solid, not farther than `most`.
fn enter(n: u32, world_line: Line, most: f32) -> Hit {
  let part = part_of(n, world_line);
  let line = in_lattice(n, world_line);
  let iso = solids[n].iso;
  let little = solids[n].little;
  let speed = length(line.way);
  let last = min(part.y, most);
  var t = part.x;
  // What was found last, at `t`; and before that.
  var now = -1.0;
  var is_known = false;
  for (var k = 0; k < MOST; k += 1) {
    if (t >= last) {
      break;
    }
    let spot = find(n, at_length(line, t + little), iso);
    let next = max(through(line, spot.low, spot.low + spot.size).y, t + 2.0 * little);
    if (!is_brick(spot)) {
      if (spot.brick == INSIDE_ALL) {
        return Hit(t, n, select(BY_SURFACE, u32(part.z), t == part.x));
      }
      t = next;
      is_known = false;
      continue;
    }
    if (!is_known) {
      now = above(spot, line, t, iso);
      is_known = true;
    }
    if (now > 0.0) {
      return Hit(t, n, select(BY_SURFACE, u32(part.z), t == part.x));
    }
    let count = max(ceil((next - t) * speed * spot.scale / STEP), 1.0);
    let step = (next - t) / count;
    var then = now;
    for (var i = 0.0; i < count; i += 1.0) {
      let from_t = t;
      let f = above(spot, line, from_t + step, iso);
      if (f > 0.0) {
        return Hit(crossing(spot, line, iso, vec2(from_t, now), vec2(from_t + step, f)), n, BY_SURFACE);
      }
      // A line that grazes rises between two looks: to where a parabola through three of them is highest.
      if (i > 0.0 && now >= then && now >= f) {
        let bend = then - 2.0 * now + f;
        let aside = 0.5 * (then - f) / min(bend, -1e-30);
        let high = now - 0.25 * (then - f) * aside;
        if (high > 0.1 * bend) {
          let top_t = from_t + clamp(aside, -1.0, 1.0) * step;
          let top = above(spot, line, top_t, iso);
          if (top > 0.0) {
            return Hit(crossing(spot, line, iso, vec2(from_t - step, then), vec2(top_t, top)), n, BY_SURFACE);
          }
        }
      }
      then = now;
      now = f;
      t = from_t + step;
    }
    t = next;
  }
  return Hit(most, NOTHING, 0u);
}

fn first_hit(line: Line, most: f32) -> Hit {
  var hit = Hit(most, NOTHING, 0u);
  for (var n = 0u; n < u32(eye.picture.z); n += 1u) {
    let found = enter(n, line, hit.t);
    if (found.solid != NOTHING) {
      hit = found;
    }
  }
  return hit;
}

// Of a place in a solid.
struct Shape {
  normal: vec3<f32>,
  ridge: f32,
  // Density, as a share of the way from black to white.
  shade: f32,
};

fn shade_of(f: f32) -> f32 {
  return clamp((f - eye.density.x) / (eye.density.y - eye.density.x), 0.0, 1.0);
}

fn shape_at(n: u32, line: Line, t: f32, by: u32, bent: bool) -> Shape {
  let map = solids[n].lattice_from_world;
  let turn = transpose(mat3x3(map[0].xyz, map[1].xyz, map[2].xyz));
  let inner = in_lattice(n, line);
  // At the middle of the range no brick is on one side alone.
  let spot = look_up(n, at_length(inner, t));
  let c = (at_length(inner, t) - spot.corner) * spot.scale;
  var shape = Shape(-line.way, 0.0, 0.0);
  if (!is_brick(spot)) {
    return shape;
  }
  let up = turn * (gradient(spot.brick, c) * spot.scale);
  let steep = max(length(up), 1e-30);
  shape.normal = -up / steep;
  if (bent) {
    let h = turn * (hessian(spot.brick, c) * (spot.scale * spot.scale)) * transpose(turn);
    let all = h[0].x + h[1].y + h[2].z;
    let curved = -(all - dot(shape.normal, h * shape.normal)) / steep;
    shape.ridge = tanh(clamp(0.5 * solids[n].cells.w * curved, -9.0, 9.0));
  }
  if (by != BY_SURFACE) {
    shape.shade = shade_of(value(spot.brick, c));
    // Out of the box across an axis, or towards the clipping plane.
    var flat = scene.cut_normal.xyz;
    if (by < 3u) {
      let axis = vec3(f32(by == 0u), f32(by == 1u), f32(by == 2u));
      let toward = normalize(turn * axis);
      flat = select(toward, -toward, dot(toward, line.way) > 0.0);
    }
    if (by == 3u || dot(shape.normal, flat) < 0.5) {
      shape.normal = flat;
    }
  }
  return shape;
}

// What a cut through the clay shows: dark where it is thin, light where it is dense.
const THIN = vec3(0.045, 0.04, 0.04);
const DENSE = vec3(0.86, 0.80, 0.70);

struct Dot {
  @location(0) color: vec4<f32>,
  @builtin(frag_depth) depth: f32,
};

fn seen_at(line: Line, t: f32, shape: Shape) -> Seen {
  var seen: Seen;
  seen.at = line.start + t * line.way;
  seen.normal = shape.normal;
  seen.ridge = shape.ridge;
  seen.clip = scene.clip_from_world * vec4(seen.at, 1.0);
  return seen;
}

// Length along a line to what was drawn behind.
fn length_to_ground(line: Line, pixel: vec2<f32>) -> f32 {
  let depth = textureLoad(ground_depth, vec2<i32>(pixel), 0);
  // Along the line depth times the last coordinate is linear, and so is that.
  let a = scene.clip_from_world * vec4(line.start, 1.0);
  let b = scene.clip_from_world * vec4(line.way, 0.0);
  let t = (depth * a.w - a.z) / (b.z - depth * b.w);
  return select(t, 1e30, depth >= 1.0);
}

fn cut_color(shape: Shape) -> vec4<f32> {
  return vec4(mix(THIN, DENSE, shape.shade * shape.shade), 1.0);
}

// Colour and depth in one pixel: in light and shadow if `lit`, else in all light.
fn pixel_of(pixel: vec2<f32>, lit: bool) -> Dot {
  let line = line_under(pixel);
  let hit = first_hit(line, length_to_ground(line, pixel));
  if (hit.solid == NOTHING) {
    return Dot(textureLoad(ground, vec2<i32>(pixel), 0), textureLoad(ground_depth, vec2<i32>(pixel), 0));
  }
  let shape = shape_at(hit.solid, line, hit.t, hit.by, !lit);
  let seen = seen_at(line, hit.t, shape);
  let depth = clamp(seen.clip.z / seen.clip.w, 0.0, 1.0);
  if (hit.by == 3u) {
    return Dot(cut_color(shape), depth);
  }
  let facing = max(dot(shape.normal, lights.way[SUN].xyz), 0.0);
  var light = 0.05;
  if (lit) {
    light += from_sky(seen.at, shape.normal) + 0.95 * facing * from_sun(seen.at, shape.normal);
  } else {
    let hollow = 1.0 + 0.45 * clamp(shape.ridge, -1.0, 0.0);
    light += (0.55 + 0.30 * dot(shape.normal, scene.axes[1].xyz)) * hollow + 0.95 * facing;
  }
  return Dot(colored(seen, true, light), depth);
}

@fragment
fn surface_plain(@builtin(position) at: vec4<f32>) -> Dot {
  return pixel_of(at.xy, false);
}

@fragment
fn surface_lit(@builtin(position) at: vec4<f32>) -> Dot {
  return pixel_of(at.xy, true);
}

// Once more where a pixel differs from those round it: four samples in place of one.
fn again(at: vec2<f32>, lit: bool) -> vec4<f32> {
  let size = vec2<i32>(eye.picture.xy) - 1;
  var low = vec3(1e30);
  var high = vec3(0.0);
  for (var i = -1; i <= 1; i += 1) {
    for (var j = -1; j <= 1; j += 1) {
      let near = textureLoad(before, clamp(vec2<i32>(at) + vec2(i, j), vec2(0), size), 0).rgb;
      low = min(low, near);
      high = max(high, near);
    }
  }
  // As the eye has it, which tells dark from less dark best.
  let differ = sqrt(high) - sqrt(low);
  if (max(differ.x, max(differ.y, differ.z)) < 0.07) {
    discard;
  }
  var sum = vec4(0.0);
  for (var n = 0u; n < 4u; n += 1u) {
    // A square turned so that no two samples share a row or a column.
    let aside = vec2(f32((0x1320u >> (4u * n)) & 3u), f32(n)) * 0.25 - 0.375;
    sum += pixel_of(at + aside, lit).color;
  }
  return sum * 0.25;
}

@fragment
fn surface_plain_again(@builtin(position) at: vec4<f32>) -> @location(0) vec4<f32> {
  return again(at.xy, false);
}

@fragment
fn surface_lit_again(@builtin(position) at: vec4<f32>) -> @location(0) vec4<f32> {
  return again(at.xy, true);
}

// What light a length takes where the density rises from black to white, up to a density; its difference over that of the density is the
// mean between two of them.
fn taken(f: f32) -> f32 {
  let span = eye.density.y - eye.density.x;
  let x = clamp(f - eye.density.x, 0.0, span);
  return 0.5 * x * x / span + max(f - eye.density.y, 0.0);
}

fn mean_taken(f: f32, g: f32) -> f32 {
  if (abs(g - f) < 1e-3 * (eye.density.y - eye.density.x)) {
    return shade_of(0.5 * (f + g));
  }
  return (taken(g) - taken(f)) / (g - f);
}

// Linear light of a density: soft parts dark and red, hard ones light.
const SOFT_PART = vec3(0.42, 0.12, 0.06);
const HARD_PART = vec3(0.90, 0.84, 0.72);

// Light that comes along a line through all solids, and the share of what is behind that still comes through.
@fragment
fn volume(@builtin(position) at: vec4<f32>) -> @location(0) vec4<f32> {
  let world_line = line_under(at.xy);
  let most = length_to_ground(world_line, at.xy);
  let span = eye.density.y - eye.density.x;
  var color = vec3(0.0);
  var left = 1.0;
  for (var n = 0u; n < u32(eye.picture.z); n += 1u) {
    let part = part_of(n, world_line);
    let line = in_lattice(n, world_line);
    let map = solids[n].lattice_from_world;
    let turn = transpose(mat3x3(map[0].xyz, map[1].xyz, map[2].xyz));
    let speed = length(line.way);
    let last = min(part.y, most);
    var t = part.x;
    var now = 0.0;
    var is_known = false;
    for (var k = 0; k < MOST; k += 1) {
      if (t >= last || left < 0.01) {
        break;
      }
      let spot = find(n, at_length(line, t + solids[n].little), eye.density.x);
      let next = min(max(through(line, spot.low, spot.low + spot.size).y, t + 2.0 * solids[n].little), last);
      if (!is_brick(spot) && spot.brick != INSIDE_ALL) {
        t = next;
        is_known = false;
        continue;
      }
      let here = look_up(n, at_length(line, t + solids[n].little));
      if (!is_known) {
        now = above(here, line, t, 0.0);
        is_known = true;
      }
      let count = max(ceil((next - t) * speed * here.scale / eye.density.w), 1.0);
      let step = (next - t) / count;
      for (var i = 0.0; i < count; i += 1.0) {
        let f = above(here, line, t + step, 0.0);
        let share = 1.0 - exp(-eye.density.z * step * mean_taken(now, f));
        if (share > 0.002) {
          let c = (at_length(line, t + 0.5 * step) - here.corner) * here.scale;
          let up = turn * (gradient(here.brick, c) * here.scale);
          let steep = length(up);
          let n_out = -up / max(steep, 1e-30);
          let facing = max(dot(n_out, lights.way[SUN].xyz), 0.0);
          let light = 0.05 + 0.55 + 0.30 * dot(n_out, scene.axes[1].xyz) + 0.95 * facing;
          // Where the density hardly changes there is no side that light could fall on.
          let is_sided = clamp(steep * eye.picture.w / (10.0 * span), 0.0, 1.0);
          let own = mix(SOFT_PART, HARD_PART, shade_of(0.5 * (now + f)));
          color += left * share * own * mix(0.7, light, is_sided);
          left *= 1.0 - share;
        }
        now = f;
        t += step;
      }
      t = next;
    }
  }
  let behind = textureLoad(ground, vec2<i32>(at.xy), 0).rgb;
  return vec4(color + left * behind, 1.0);
}
