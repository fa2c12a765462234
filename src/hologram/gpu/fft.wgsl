// One pass of Stockham's transform over many lines: each thread takes one butterfly of one line through memory.

struct Pass {
    // Length of a line, and the product of the radices of the passes before.
    length: u32,
    span: u32,
    // Distance of a line's samples, and of the lines.
    stride: u32,
    pitch: u32,
    lines: u32,
    // Whether neighbouring threads take neighbouring lines, instead of neighbouring butterflies of one.
    across: u32,
    // Sign of the exponent.
    sign: f32,
    unused: u32,
}

@group(0) @binding(0) var<uniform> job: Pass;
// exp(i2πm/length).
@group(0) @binding(1) var<storage, read> roots: array<vec2<f32>>;
@group(0) @binding(2) var<storage, read> before: array<vec2<f32>>;
@group(0) @binding(3) var<storage, read_write> after: array<vec2<f32>>;

fn times(a: vec2<f32>, b: vec2<f32>) -> vec2<f32> {
    return vec2(a.x * b.x - a.y * b.y, a.x * b.y + a.y * b.x);
}

// ±i·v.
fn turned(v: vec2<f32>) -> vec2<f32> {
    return vec2(-v.y, v.x) * job.sign;
}

// Butterfly and line of a thread.
fn place(id: vec3<u32>) -> vec2<u32> {
    return select(id.xy, id.yx, job.across == 1u);
}

fn is_outside(at: vec2<u32>, radix: u32) -> bool {
    return at.x >= job.length / radix || at.y >= job.lines;
}

// Sample `n` of a butterfly, times its root of unity.
fn sample(at: vec2<u32>, n: u32, radix: u32) -> vec2<f32> {
    let v = before[(at.x + n * (job.length / radix)) * job.stride + at.y * job.pitch];
    let root = roots[n * (at.x % job.span) * (job.length / (job.span * radix))];
    return times(v, vec2(root.x, root.y * job.sign));
}

fn store(at: vec2<u32>, n: u32, radix: u32, v: vec2<f32>) {
    let k = at.x % job.span;
    after[((at.x - k) * radix + k + n * job.span) * job.stride + at.y * job.pitch] = v;
}

@compute @workgroup_size(64)
fn radix2(@builtin(global_invocation_id) id: vec3<u32>) {
    let at = place(id);
    if (is_outside(at, 2u)) {
        return;
    }
    let a = sample(at, 0u, 2u);
    let b = sample(at, 1u, 2u);
    store(at, 0u, 2u, a + b);
    store(at, 1u, 2u, a - b);
}

@compute @workgroup_size(64)
fn radix3(@builtin(global_invocation_id) id: vec3<u32>) {
    let at = place(id);
    if (is_outside(at, 3u)) {
        return;
    }
    let a = sample(at, 0u, 3u);
    let b = sample(at, 1u, 3u);
    let c = sample(at, 2u, 3u);
    let even = a - 0.5 * (b + c);
    let odd = turned(b - c) * 0.8660254;
    store(at, 0u, 3u, a + (b + c));
    store(at, 1u, 3u, even + odd);
    store(at, 2u, 3u, even - odd);
}

@compute @workgroup_size(64)
fn radix4(@builtin(global_invocation_id) id: vec3<u32>) {
    let at = place(id);
    if (is_outside(at, 4u)) {
        return;
    }
    let a = sample(at, 0u, 4u);
    let b = sample(at, 1u, 4u);
    let c = sample(at, 2u, 4u);
    let d = sample(at, 3u, 4u);
    let odd = turned(b - d);
    store(at, 0u, 4u, (a + c) + (b + d));
    store(at, 1u, 4u, (a - c) + odd);
    store(at, 2u, 4u, (a + c) - (b + d));
    store(at, 3u, 4u, (a - c) - odd);
}

@compute @workgroup_size(64)
fn radix5(@builtin(global_invocation_id) id: vec3<u32>) {
    let at = place(id);
    if (is_outside(at, 5u)) {
        return;
    }
    let a = sample(at, 0u, 5u);
    let b = sample(at, 1u, 5u);
    let c = sample(at, 2u, 5u);
    let d = sample(at, 3u, 5u);
    let e = sample(at, 4u, 5u);
    // Cosines and sines of a fifth and of two fifths of a turn.
    let even1 = a + 0.30901699 * (b + e) - 0.80901699 * (c + d);
    let even2 = a - 0.80901699 * (b + e) + 0.30901699 * (c + d);
    let odd1 = turned(0.95105652 * (b - e) + 0.58778525 * (c - d));
    let odd2 = turned(0.58778525 * (b - e) - 0.95105652 * (c - d));
    store(at, 0u, 5u, a + (b + e) + (c + d));
    store(at, 1u, 5u, even1 + odd1);
    store(at, 2u, 5u, even2 + odd2);
    store(at, 3u, 5u, even2 - odd2);
    store(at, 4u, 5u, even1 - odd1);
}
