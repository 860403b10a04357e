// A picture of the scene in its place in the window.

@group(0) @binding(0) var picture: texture_2d<f32>;
@group(0) @binding(1) var nearby: sampler;

struct Seen {
  @builtin(position) clip: vec4<f32>,
  @location(0) place: vec2<f32>,
};

// One triangle over all of the place.
@vertex
fn corner(@builtin(vertex_index) n: u32) -> Seen {
  let place = vec2(f32((n << 1u) & 2u), f32(n & 2u));
  var out: Seen;
  out.clip = vec4(2.0 * place.x - 1.0, 1.0 - 2.0 * place.y, 0.0, 1.0);
  out.place = place;
  return out;
}

@fragment
fn color(in: Seen) -> @location(0) vec4<f32> {
  return textureSampleLevel(picture, nearby, in.place, 0.0);
}
