// Draws blocks as the mesh kernel leaves them: positions count from the lowest sample of a block's brick.

@group(0) @binding(0) var<uniform> clip_from_world: mat4x4f;

struct Corner {
    @builtin(position) clip: vec4f,
    @location(0) normal: vec3f,
}

@vertex
fn vertex(@location(0) position: vec4u, @location(1) normal: vec3f, @location(2) origin: vec3i) -> Corner {
    let world = vec3f(origin) + vec3f(position.xyz) / 4096.0;
    return Corner(clip_from_world * vec4f(world, 1.0), normal);
}

@fragment
fn fragment(corner: Corner) -> @location(0) vec4f {
    let normal = normalize(corner.normal);
    let sun = max(dot(normal, normalize(vec3f(0.6, 0.7, 0.4))), 0.0);
    let earth = mix(vec3f(0.42, 0.3, 0.2), vec3f(0.35, 0.45, 0.2), smoothstep(0.75, 0.95, normal.y));
    return vec4f(earth * (0.35 + 0.85 * sun), 1.0);
}
