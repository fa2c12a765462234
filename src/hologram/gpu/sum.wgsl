// Sums points over tiles of pixels. What the phases are measured from, the centre of a cell, comes from f64; here
// only differences to it are computed, at most some ninety turns, and every phase is reduced to turns before its sine.

struct Job {
    // Step per column and per row [m]; rows run against y.
    pitch: vec2<f32>,
    // Segment coordinate of a direction's sine: scale·sine + offset.
    scale: vec2<f32>,
    offset: vec2<f32>,
    // q = edge·(1 − sine²)/r [m].
    edge: vec2<f32>,
    // Tangent of the cone's half angle, of the hard cut.
    tangent: vec2<f32>,
    // 1/λ [1/m].
    wavenumber: f32,
    // Lowest q of the edge table, and its levels per unit of q.
    lowest: f32,
    density: f32,
    levels: u32,
    // 0: bare sphere, 1: hard cut, 2: soft taper.
    limit: u32,
    // Size of the band [px].
    width: u32,
    height: u32,
    unused: u32,
}

struct Point {
    // Sines of the direction from the point to the cell's centre, 1/R [1/m], and the phase there [turns].
    sine: vec2<f32>,
    inverse: f32,
    base: f32,
    // ±R/λ, a/R, ±1, |z| [m].
    turns: f32,
    amplitude: f32,
    sign: f32,
    distance: f32,
}

@group(0) @binding(0) var<uniform> job: Job;
@group(0) @binding(1) var<storage, read> points: array<Point>;
// Column and row of a cell's first pixel, its first point and their number.
@group(0) @binding(2) var<storage, read> cells: array<vec4<u32>>;
@group(0) @binding(3) var<storage, read> edges: array<f32>;
@group(0) @binding(4) var<storage, read_write> field: array<vec2<f32>>;

const CELL = 256u;
const TILE = 32u;
const BATCH = 16u;

struct Complex4 {
    re: vec4<f32>,
    im: vec4<f32>,
}

// exp(i2π·turns): the polynomials of the CPU's kernels, since a shading language promises a sine to 5e-4 only.
fn cis(turns: vec4<f32>) -> Complex4 {
    let f = turns - round(turns);
    let w = f * f;
    var c = vec4(-21.071106);
    c = fma(c, w, vec4(58.79049));
    c = fma(c, w, vec4(-85.27162));
    c = fma(c, w, vec4(64.92866));
    c = fma(c, w, vec4(-19.73898));
    c = fma(c, w, vec4(0.9999992));
    var s = vec4(-12.471244);
    s = fma(s, w, vec4(41.34288));
    s = fma(s, w, vec4(-76.61447));
    s = fma(s, w, vec4(81.599945));
    s = fma(s, w, vec4(-41.34159));
    s = fma(s, w, vec4(6.2831855));
    return Complex4(c, s * f);
}

fn level(q: f32) -> u32 {
    return min(u32(max((q - job.lowest) * job.density + 0.5, 0.0)), job.levels - 1u) * 128u;
}

fn edge(t: f32, level: u32) -> vec2<f32> {
    let inside = clamp(t, 0.0, 15.99999);
    let segment = u32(inside);
    let w = inside - f32(segment);
    let at = level + segment;
    let re = fma(fma(fma(edges[at + 48u], w, edges[at + 32u]), w, edges[at + 16u]), w, edges[at]);
    let im = fma(fma(fma(edges[at + 112u], w, edges[at + 96u]), w, edges[at + 80u]), w, edges[at + 64u]);
    return vec2(re, im);
}

// T of four segment coordinates.
fn taper(t: vec4<f32>, level: u32) -> Complex4 {
    if (all(t <= vec4(0.0))) {
        return Complex4(vec4(1.0), vec4(0.0));
    }
    let a = edge(t.x, level);
    let b = edge(t.y, level);
    let c = edge(t.z, level);
    let d = edge(t.w, level);
    return Complex4(vec4(a.x, b.x, c.x, d.x), vec4(a.y, b.y, c.y, d.y));
}

// A point seen from a tile's centre.
struct Seen {
    sine: vec2<f32>,
    inverse: f32,
    base: f32,
    amplitude: f32,
}

// `offset` from the cell's centre [m].
fn seen(p: Point, offset: vec2<f32>) -> Seen {
    let e = offset * p.inverse;
    let delta = e.x * (2.0 * p.sine.x + e.x) + e.y * (2.0 * p.sine.y + e.y);
    let rho = sqrt(max(1.0 + delta, 1e-12));
    let turns = p.turns * (delta / (1.0 + rho)) + p.base;
    return Seen((p.sine + e) / rho, p.inverse / rho, turns - round(turns), p.amplitude / rho);
}

// The factor of one axis at the indexes u from the tile's centre: third order of the sphere about it.
fn factor(p: Point, view: Seen, axis: u32, u: vec4<f32>, base: f32, amplitude: f32) -> Complex4 {
    let s = view.sine[axis];
    let step = job.pitch[axis] * view.inverse;
    let bend = 1.0 - s * s;
    let first = p.sign * job.pitch[axis] * job.wavenumber;
    let second = 0.5 * first * bend * step;
    let third = -second * s * step;
    let wave = cis(fma(fma(fma(vec4(third), u, vec4(second)), u, vec4(first * s)), u, vec4(base)));
    let size = amplitude * (1.0 - s * step * u);
    if (job.limit == 1u) {
        let position = abs(s / view.inverse + u * job.pitch[axis]);
        let lit = select(vec4(0.0), size, position <= vec4(p.distance * job.tangent[axis]));
        return Complex4(wave.re * lit, wave.im * lit);
    }
    if (job.limit == 2u) {
        let side = select(job.scale[axis], -job.scale[axis], s < 0.0);
        let slope = side * bend * step;
        let t = fma(fma(vec4(-1.5 * slope * s * step), u, vec4(slope)), u, vec4(side * s + job.offset[axis]));
        let edge = taper(t, level(job.edge[axis] * bend * view.inverse));
        let im = p.sign * edge.im;
        return Complex4((wave.re * edge.re - wave.im * im) * size, (wave.im * edge.re + wave.re * im) * size);
    }
    return Complex4(wave.re * size, wave.im * size);
}

// Factors of a batch, four columns or rows a vector.
var<workgroup> x_re: array<vec4<f32>, 128>;
var<workgroup> x_im: array<vec4<f32>, 128>;
var<workgroup> y_re: array<vec4<f32>, 128>;
var<workgroup> y_im: array<vec4<f32>, 128>;

// Four pixels of the field so far; sums go on from it, so that they are the same bits wherever the points were divided.
fn so_far(column: u32, row: u32) -> Complex4 {
    var sum = Complex4(vec4(0.0), vec4(0.0));
    if (row < job.height) {
        for (var i = 0u; i < 4u; i++) {
            if (column + i < job.width) {
                let u = field[row * job.width + column + i];
                sum.re[i] = u.x;
                sum.im[i] = u.y;
            }
        }
    }
    return sum;
}

fn store(column: u32, row: u32, re: vec4<f32>, im: vec4<f32>) {
    if (row >= job.height) {
        return;
    }
    for (var i = 0u; i < 4u; i++) {
        if (column + i < job.width) {
            field[row * job.width + column + i] = vec2(re[i], im[i]);
        }
    }
}

// The sphere as a product over the tile: eight by eight threads of four by four pixels.
@compute @workgroup_size(64)
fn separable(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) thread: u32) {
    let cell = cells[group.y];
    let tile = vec2(group.x % (CELL / TILE), group.x / (CELL / TILE)) * TILE;
    if (cell.x + tile.x >= job.width || cell.y + tile.y >= job.height) {
        return;
    }
    let center = (vec2<f32>(tile) + 15.5 - 127.5) * job.pitch;
    let place = vec2(thread % 8u, thread / 8u);
    let mine = thread / 4u;
    let part = (thread % 4u) * 2u;
    let lane = vec4(0.0, 1.0, 2.0, 3.0) - 15.5;
    let column = cell.x + tile.x + 4u * place.x;
    let row = cell.y + tile.y + 4u * place.y;
    let sum0 = so_far(column, row);
    let sum1 = so_far(column, row + 1u);
    let sum2 = so_far(column, row + 2u);
    let sum3 = so_far(column, row + 3u);
    var re0 = sum0.re;
    var re1 = sum1.re;
    var re2 = sum2.re;
    var re3 = sum3.re;
    var im0 = sum0.im;
    var im1 = sum1.im;
    var im2 = sum2.im;
    var im3 = sum3.im;
    for (var first = 0u; first < cell.w; first += BATCH) {
        let count = min(BATCH, cell.w - first);
        if (mine < count) {
            let p = points[cell.z + first + mine];
            let view = seen(p, center);
            for (var i = part; i < part + 2u; i++) {
                let u = lane + 4.0 * f32(i);
                let x = factor(p, view, 0u, u, view.base, view.amplitude);
                let y = factor(p, view, 1u, u, 0.0, 1.0);
                x_re[mine * 8u + i] = x.re;
                x_im[mine * 8u + i] = x.im;
                y_re[mine * 8u + i] = y.re;
                y_im[mine * 8u + i] = y.im;
            }
        }
        workgroupBarrier();
        for (var k = 0u; k < count; k++) {
            let xr = x_re[k * 8u + place.x];
            let xi = x_im[k * 8u + place.x];
            let yr = y_re[k * 8u + place.y];
            let yi = y_im[k * 8u + place.y];
            re0 += yr.x * xr - yi.x * xi;
            im0 += yr.x * xi + yi.x * xr;
            re1 += yr.y * xr - yi.y * xi;
            im1 += yr.y * xi + yi.y * xr;
            re2 += yr.z * xr - yi.z * xi;
            im2 += yr.z * xi + yi.z * xr;
            re3 += yr.w * xr - yi.w * xi;
            im3 += yr.w * xi + yi.w * xr;
        }
        workgroupBarrier();
    }
    store(column, row, re0, im0);
    store(column, row + 1u, re1, im1);
    store(column, row + 2u, re2, im2);
    store(column, row + 3u, re3, im3);
}

// Every pixel from its own path: for angles and distances at which no tile is small enough.
@compute @workgroup_size(64)
fn exact(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) thread: u32) {
    let cell = cells[group.y];
    let tile = vec2(group.x % (CELL / TILE), group.x / (CELL / TILE)) * TILE;
    let column = tile.x + 4u * (thread % 8u);
    let offset_x = (f32(column) - 127.5 + vec4(0.0, 1.0, 2.0, 3.0)) * job.pitch.x;
    for (var j = 0u; j < 4u; j++) {
        let row = tile.y + 4u * (thread / 8u) + j;
        if (cell.x + column >= job.width || cell.y + row >= job.height) {
            continue;
        }
        let offset_y = (f32(row) - 127.5) * job.pitch.y;
        let sum = so_far(cell.x + column, cell.y + row);
        var re = sum.re;
        var im = sum.im;
        for (var k = cell.z; k < cell.z + cell.w; k++) {
            let p = points[k];
            let ex = offset_x * p.inverse;
            let ey = offset_y * p.inverse;
            let delta = ex * (2.0 * p.sine.x + ex) + ey * (2.0 * p.sine.y + ey);
            let rho = sqrt(max(1.0 + delta, vec4(1e-12)));
            let wave = cis(p.turns * (delta / (1.0 + rho)) + p.base);
            var size = p.amplitude / rho;
            if (job.limit == 2u) {
                let sx = abs(p.sine.x + ex) / rho;
                let sy = abs(p.sine.y + ey) / rho;
                // q varies little over four pixels: that of the second serves them.
                let tx = taper(sx * job.scale.x + job.offset.x, level(job.edge.x * (1.0 - sx.y * sx.y) * p.inverse / rho.y));
                let ty = taper(sy * job.scale.y + job.offset.y, level(job.edge.y * (1.0 - sy.y * sy.y) * p.inverse / rho.y));
                let tr = (tx.re * ty.re - tx.im * ty.im) * size;
                let ti = (tx.re * ty.im + tx.im * ty.re) * size * p.sign;
                re += wave.re * tr - wave.im * ti;
                im += wave.im * tr + wave.re * ti;
                continue;
            }
            if (job.limit == 1u) {
                let dx = abs(p.sine.x + ex) / p.inverse;
                let dy = abs(p.sine.y + ey) / p.inverse;
                let lit = (dx <= vec4(p.distance * job.tangent.x)) & vec4(dy <= p.distance * job.tangent.y);
                size = select(vec4(0.0), size, lit);
            }
            re += wave.re * size;
            im += wave.im * size;
        }
        store(cell.x + column, cell.y + row, re, im);
    }
}
