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
  // Density of a second surface, looked through in the volume, and whether there is one.
  second: vec4<f32>,
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
// After these the ranges of its cells, two in each number, as shares of the range of the brick, which comes last.
const RANGES: u32 = 1331u;
const LEAST: u32 = 1587u;
const SPAN: u32 = 1588u;
const BRICK: u32 = 1589u;

@group(2) @binding(0) var<uniform> eye: Eye;
@group(2) @binding(1) var<storage, read> solids: array<Solid>;
@group(2) @binding(2) var<storage, read> nodes: array<Node>;
@group(2) @binding(3) var<storage, read> bricks: array<u32>;
// What is behind, and how far away; what a first look found.
@group(3) @binding(0) var ground: texture_2d<f32>;
@group(3) @binding(1) var ground_depth: texture_depth_2d;
@group(3) @binding(2) var before: texture_2d<f32>;
// Colours of paint on the triangles, clear where there are none.
@group(3) @binding(3) var paints: texture_2d<f32>;

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

// The coefficients that a cell is evaluated from, row by row along z: read once, for to read takes longer than all else.
struct Cell {
  rows: array<vec4<f32>, 16>,
};

fn read_cell(brick: u32, cell: vec3<f32>) -> Cell {
  let k = vec3<u32>(cell);
  let x0 = brick * BRICK + (k.x * HALO + k.y) * HALO + k.z;
  let x1 = x0 + HALO * HALO;
  let x2 = x1 + HALO * HALO;
  let x3 = x2 + HALO * HALO;
  return Cell(array<vec4<f32>, 16>(
    row(x0), row(x0 + HALO), row(x0 + 2u * HALO), row(x0 + 3u * HALO),
    row(x1), row(x1 + HALO), row(x1 + 2u * HALO), row(x1 + 3u * HALO),
    row(x2), row(x2 + HALO), row(x2 + 2u * HALO), row(x2 + 3u * HALO),
    row(x3), row(x3 + HALO), row(x3 + 2u * HALO), row(x3 + 3u * HALO),
  ));
}

fn weighed(c: Cell, x: vec4<f32>, y: vec4<f32>, z: vec4<f32>) -> f32 {
  let r = c.rows;
  let plane_0 = y.x * r[0] + y.y * r[1] + y.z * r[2] + y.w * r[3];
  let plane_1 = y.x * r[4] + y.y * r[5] + y.z * r[6] + y.w * r[7];
  let plane_2 = y.x * r[8] + y.y * r[9] + y.z * r[10] + y.w * r[11];
  let plane_3 = y.x * r[12] + y.y * r[13] + y.z * r[14] + y.w * r[15];
  return dot(z, x.x * plane_0 + x.y * plane_1 + x.z * plane_2 + x.w * plane_3);
}

// At a place of the cell, 0 to 1 along each axis.
fn value(c: Cell, t: vec3<f32>) -> f32 {
  return weighed(c, weights(t.x), weights(t.y), weights(t.z));
}

// By the cell.
fn gradient(c: Cell, t: vec3<f32>) -> vec3<f32> {
  let x = weights(t.x);
  let y = weights(t.y);
  let z = weights(t.z);
  return vec3(weighed(c, slopes(t.x), y, z), weighed(c, x, slopes(t.y), z), weighed(c, x, y, slopes(t.z)));
}

fn hessian(c: Cell, t: vec3<f32>) -> mat3x3<f32> {
  let x = weights(t.x);
  let y = weights(t.y);
  let z = weights(t.z);
  let dx = slopes(t.x);
  let dy = slopes(t.y);
  let dz = slopes(t.z);
  let xy = weighed(c, dx, dy, z);
  let xz = weighed(c, dx, y, dz);
  let yz = weighed(c, x, dy, dz);
  return mat3x3(
    weighed(c, bends(t.x), y, z), xy, xz,
    xy, weighed(c, x, bends(t.y), z), yz,
    xz, yz, weighed(c, x, y, bends(t.z)),
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

// A cube on one side of the density, or an octant of a brick.
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
  var at = solids[solid].root;
  var low = vec3(0.0);
  var size = solids[solid].width;
  for (var depth = 0; depth < 40; depth += 1) {
    if (nodes[at].high <= level || nodes[at].low > level) {
      return Spot(low, size, select(INSIDE_ALL, OUTSIDE, nodes[at].high <= level), low, 1.0);
    }
    let half = 0.5 * size;
    let is_far = p >= low + half;
    let next = nodes[at].octants[4u * u32(is_far.x) + 2u * u32(is_far.y) + u32(is_far.z)];
    let corner = select(low, low + half, is_far);
    if (next == OWN) {
      return Spot(corner, half, nodes[at].brick, low, CELLS / size);
    }
    if (next >= INSIDE_ALL) {
      return Spot(corner, half, next, low, 1.0);
    }
    at = next;
    low = corner;
    size = half;
  }
  return Spot(low, size, OUTSIDE, low, 1.0);
}

// Least and largest coefficient of a cell, given those of the brick.
fn range_of(brick: u32, cell: vec3<f32>, least: f32, span: f32) -> vec2<f32> {
  let k = vec3<u32>(cell);
  let n = (k.x * 8u + k.y) * 8u + k.z;
  let word = bricks[brick * BRICK + RANGES + n / 2u] >> (16u * (n & 1u));
  return least + span * unpack4x8unorm(word).xy;
}

// The octant of a cube round a place of a solid, with the brick that is drawn there, whatever its density.
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
      return Spot(select(low, low + half, is_far), half, brick, low, CELLS / size);
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

// Most cubes on a line, most cells of one, and most steps to the surface once it is passed.
const MOST: i32 = 1000;
const MOST_CELLS: i32 = 12;
const NEARER: i32 = 8;

// Where the density between two lengths along a line through a cell rises through that of the surface: regula falsi as the Illinois rule
// has it [Dowell71].
fn crossing(c: Cell, line: Line, iso: f32, outside: vec2<f32>, inside: vec2<f32>) -> f32 {
  var a = outside;
  var b = inside;
  var side = 0;
  for (var n = 0; n < NEARER; n += 1) {
    let t = clamp((a.x * b.y - b.x * a.y) / (b.y - a.y), a.x, b.x);
    let f = value(c, at_length(line, t)) - iso;
    if (abs(f) < 1e-5 * (inside.y - outside.y)) {
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

// The first way into the surface between two lengths along a line through a cell; before them where there is none.
fn enter_cell(c: Cell, line: Line, iso: f32, from_t: f32, to_t: f32) -> f32 {
  let f_a = value(c, at_length(line, from_t)) - iso;
  if (f_a > 0.0) {
    return from_t;
  }
  let half = 0.5 * (to_t - from_t);
  let mid = from_t + half;
  let f_m = value(c, at_length(line, mid)) - iso;
  let f_b = value(c, at_length(line, to_t)) - iso;
  var inside = vec2(mid, f_m);
  var outside = vec2(from_t, f_a);
  if (f_m <= 0.0) {
    inside = vec2(to_t, f_b);
    outside = vec2(mid, f_m);
    // A line that grazes rises between two looks: to where a parabola through all three is highest.
    let bend = f_a - 2.0 * f_m + f_b;
    let aside = 0.5 * (f_a - f_b) / min(bend, -1e-30);
    let high = f_m - 0.25 * (f_a - f_b) * aside;
    if (bend < 0.0 && abs(aside) < 1.0 && high > 0.2 * bend) {
      let top = mid + aside * half;
      let f_top = value(c, at_length(line, top)) - iso;
      if (f_top > 0.0) {
        inside = vec2(top, f_top);
        if (aside < 0.0) {
          outside = vec2(from_t, f_a);
        }
      }
    }
  }
  if (inside.y <= 0.0) {
    return from_t - 1.0;
  }
  return crossing(c, line, iso, outside, inside);
}

// The first way into one solid, not farther than `most`.
fn enter(n: u32, world_line: Line, most: f32) -> Hit {
  let part = part_of(n, world_line);
  let line = in_lattice(n, world_line);
  let iso = solids[n].iso;
  let little = solids[n].little;
  let last = min(part.y, most);
  var t = part.x;
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
      continue;
    }
    let least = bitcast<f32>(bricks[spot.brick * BRICK + LEAST]);
    let span = bitcast<f32>(bricks[spot.brick * BRICK + SPAN]);
    let in_brick = Line((line.start - spot.corner) * spot.scale, line.way * spot.scale);
    let first = (spot.low - spot.corner) * spot.scale;
    for (var i = 0; i < MOST_CELLS; i += 1) {
      if (t >= next) {
        break;
      }
      let cell = clamp(floor(at_length(in_brick, t + little)), first, first + 3.0);
      let to_t = clamp(through(in_brick, cell, cell + 1.0).y, t + 2.0 * little, next + 2.0 * little);
      let range = range_of(spot.brick, cell, least, span);
      if (range.y > iso) {
        if (range.x > iso) {
          return Hit(t, n, select(BY_SURFACE, u32(part.z), t == part.x));
        }
        let in_cell = Line(in_brick.start - cell, in_brick.way);
        let hit = enter_cell(read_cell(spot.brick, cell), in_cell, iso, t, to_t);
        if (hit >= t) {
          return Hit(hit, n, select(BY_SURFACE, u32(part.z), hit == part.x));
        }
      }
      t = to_t;
    }
    t = max(t, next);
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
  let at = (at_length(inner, t) - spot.corner) * spot.scale;
  let cell = clamp(floor(at), vec3(0.0), vec3(CELLS - 1.0));
  let has_brick = is_brick(spot);
  let c = read_cell(select(0u, spot.brick, has_brick), cell);
  var shape = Shape(-line.way, 0.0, 0.0);
  let up = turn * (gradient(c, at - cell) * spot.scale);
  let steep = max(length(up), 1e-30);
  shape.normal = -up / steep;
  if (bent) {
    let h = turn * (hessian(c, at - cell) * (spot.scale * spot.scale)) * transpose(turn);
    let all = h[0].x + h[1].y + h[2].z;
    let curved = -(all - dot(shape.normal, h * shape.normal)) / steep;
    shape.ridge = tanh(clamp(0.5 * solids[n].cells.w * curved, -9.0, 9.0));
  }
  if (by != BY_SURFACE) {
    shape.shade = shade_of(value(c, at - cell));
    // Out of the box across an axis, or towards the clipping plane.
    var flat = scene.cut_normal.xyz;
    if (by < 3u) {
      let axis = vec3(f32(by == 0u), f32(by == 1u), f32(by == 2u));
      let toward = normalize(turn * axis);
      flat = select(toward, -toward, dot(toward, line.way) > 0.0);
    }
    if (by == 3u || !has_brick || dot(shape.normal, flat) < 0.5) {
      shape.normal = flat;
    }
  }
  return shape;
}

struct Dot {
  @location(0) color: vec4<f32>,
  @builtin(frag_depth) depth: f32,
};

fn seen_at(line: Line, t: f32, shape: Shape) -> Seen {
  var seen: Seen;
  let at = line.start + t * line.way;
  seen.normal_paint = vec4(shape.normal, 0.0);
  seen.at_ridge = vec4(at, shape.ridge);
  seen.clip = scene.clip_from_world * vec4(at, 1.0);
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

// What is painted on the triangles in a pixel, or beside it: their silhouettes are the surface's within one.
fn paint_under(pixel: vec2<f32>) -> vec3<f32> {
  if (scene.shows.x < 0.5) {
    return CLAY;
  }
  let size = vec2<i32>(textureDimensions(paints)) - 1;
  if (size.x == 0) {
    return CLAY;
  }
  var near = array<vec2<i32>, 5>(vec2(0), vec2(1, 0), vec2(-1, 0), vec2(0, 1), vec2(0, -1));
  for (var n = 0; n < 5; n += 1) {
    let paint = textureLoad(paints, clamp(vec2<i32>(pixel) + near[n], vec2(0), size), 0);
    if (paint.a > 0.5) {
      return paint.rgb;
    }
  }
  return CLAY;
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
    light += all_sky(shape.normal) * from_sky(seen.at_ridge.xyz, shape.normal) + 0.95 * facing * from_sun(seen.at_ridge.xyz, shape.normal);
  } else {
    let hollow = 1.0 + 0.45 * clamp(shape.ridge, -1.0, 0.0);
    light += all_sky(shape.normal) * hollow + 0.95 * facing;
  }
  return Dot(vec4(paint_under(pixel) * light, 1.0), depth);
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
  if (max(differ.x, max(differ.y, differ.z)) < 0.1) {
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
    let little = solids[n].little;
    let second = solids[n].second.x;
    let has_second = solids[n].second.y > 0.5;
    let lowest = select(eye.density.x, min(eye.density.x, second), has_second);
    var t = part.x;
    for (var k = 0; k < MOST; k += 1) {
      if (t >= last || left < 0.03) {
        break;
      }
      let spot = find(n, at_length(line, t + little), lowest);
      if (spot.brick == OUTSIDE) {
        t = max(through(line, spot.low, spot.low + spot.size).y, t + 2.0 * little);
        continue;
      }
      // A cube that is all above the least density may be far larger than the brick in which the line is.
      let here = look_up(n, at_length(line, t + little));
      let next = min(max(through(line, here.low, here.low + here.size).y, t + 2.0 * little), last);
      let least = bitcast<f32>(bricks[here.brick * BRICK + LEAST]);
      let span_here = bitcast<f32>(bricks[here.brick * BRICK + SPAN]);
      let in_brick = Line((line.start - here.corner) * here.scale, line.way * here.scale);
      for (var j = 0; j < 2 * MOST_CELLS; j += 1) {
        if (t >= next || left < 0.03) {
          break;
        }
        let cell = clamp(floor(at_length(in_brick, t + little)), vec3(0.0), vec3(CELLS - 1.0));
        let to_t = min(max(through(in_brick, cell, cell + 1.0).y, t + 2.0 * little), max(next, t + 2.0 * little));
        if (range_of(here.brick, cell, least, span_here).y > lowest) {
          let c = read_cell(here.brick, cell);
          let in_cell = Line(in_brick.start - cell, in_brick.way);
          let count = max(ceil((to_t - t) * speed * here.scale / eye.density.w), 1.0);
          let step = (to_t - t) / count;
          let mid = at_length(in_cell, 0.5 * (t + to_t));
          let up = turn * (gradient(c, mid) * here.scale);
          let steep = length(up);
          let n_out = -up / max(steep, 1e-30);
          let facing = max(dot(n_out, lights.way[SUN].xyz), 0.0);
          let light = 0.05 + 0.55 + 0.30 * dot(n_out, scene.axes[1].xyz) + 0.95 * facing;
          // Where the density hardly changes there is no side that light could fall on.
          let is_sided = clamp(steep * eye.picture.w / (10.0 * span), 0.0, 1.0);
          let lit = mix(0.7, light, is_sided);
          var now = value(c, at_length(in_cell, t));
          for (var i = 0.0; i < count; i += 1.0) {
            let f = value(c, at_length(in_cell, t + (i + 1.0) * step));
            let share = 1.0 - exp(-eye.density.z * step * mean_taken(now, f));
            let own = mix(SOFT_PART, HARD_PART, shade_of(0.5 * (now + f)));
            color += left * share * own * lit;
            left *= 1.0 - share;
            if (has_second && (now < second) != (f < second)) {
              let across = at_length(in_cell, t + (i + (second - now) / (f - now)) * step);
              let rise = turn * gradient(c, across);
              let veil = veil_of(-rise / max(length(rise), 1e-30));
              color += left * veil.a * veil.rgb;
              left *= 1.0 - veil.a;
            }
            now = f;
          }
        }
        t = to_t;
      }
      t = max(t, next);
    }
  }
  let behind = textureLoad(ground, vec2<i32>(at.xy), 0).rgb;
  return vec4(color + left * behind, 1.0);
}
