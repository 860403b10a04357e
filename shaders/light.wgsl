// What reaches every second pixel of a whole picture, across and down, of the sky's light and of the sun's: first where surfaces are and how
// they lie, then what they see of both.

@group(2) @binding(0) var normals: texture_2d<f32>;
@group(2) @binding(1) var depths: texture_depth_2d;

@fragment
fn normal_of(in: Seen) -> @location(0) vec4<f32> {
  return vec4(normalize(in.normal_paint.xyz), 1.0);
}

@fragment
fn light_of(in: Paper) -> @location(0) vec2<u32> {
  let pixel = vec2<i32>(in.clip.xy);
  let normal = textureLoad(normals, pixel, 0);
  if (normal.w < 0.5) {
    discard;
  }
  let depth = textureLoad(depths, pixel, 0);
  let across = vec2(4.0, -4.0) * in.clip.xy / scene.picture.xy + vec2(-1.0, 1.0);
  let q = scene.world_from_clip * vec4(across, depth, 1.0);
  let at = q.xyz / q.w;
  let reaches = vec2(from_sky(at, normal.xyz), from_sun(at, normal.xyz));
  return vec2(bitcast<u32>(depth), pack2x16unorm(reaches));
}
