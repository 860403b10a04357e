// The light that reaches each pixel, of one sample: first where surfaces are and how they lie, then their light, each pixel once.

@group(2) @binding(0) var normals: texture_2d<f32>;
@group(2) @binding(1) var depths: texture_depth_2d;

@fragment
fn normal_of(in: Seen) -> @location(0) vec4<f32> {
  return vec4(normalize(in.normal), 1.0);
}

@fragment
fn light_of(in: Paper) -> @location(0) vec4<f32> {
  let pixel = vec2<i32>(in.clip.xy);
  let normal = textureLoad(normals, pixel, 0);
  if (normal.w < 0.5) {
    discard;
  }
  let across = vec2(2.0, -2.0) * in.clip.xy / scene.picture.xy + vec2(-1.0, 1.0);
  let q = scene.world_from_clip * vec4(across, textureLoad(depths, pixel, 0), 1.0);
  let at = q.xyz / q.w;
  let n = normal.xyz;
  let facing = max(dot(n, lights.way[SUN].xyz), 0.0);
  return vec4(0.05 + from_sky(at, n) + 0.95 * facing * from_sun(at, n), 0.0, 0.0, 1.0);
}
