// Recording planes: points painted as products of tabulated kernels, planes added on the spectrum, the panel's window.

struct Paint {
    // Size of a plane's painted part [px].
    width: u32,
    height: u32,
    // Tiles of this dispatch, in rows of `across`.
    count: u32,
    across: u32,
    // Values of a table's row, index of a kernel's middle in it, and lines of a level, by axis.
    row: vec2<u32>,
    middle: vec2<i32>,
    lines: vec2<u32>,
    // The power of d/h.
    moment: u32,
    unused: u32,
}

struct Stroke {
    // The pixel at or before the point.
    pixel: vec2<i32>,
    // Line of the kernel in the table of its axis, and what is beyond it in depth and in sub-pixel position.
    line: vec2<u32>,
    depth: vec2<f32>,
    part: vec2<f32>,
    factor: vec2<f32>,
    // Sign of d, and d/h.
    sign: f32,
    ratio: f32,
}

@group(0) @binding(0) var<uniform> paint: Paint;
@group(0) @binding(1) var<storage, read> strokes: array<Stroke>;
@group(0) @binding(2) var<storage, read> lists: array<u32>;
// Column and row of a tile, its first stroke in the lists and their number.
@group(0) @binding(3) var<storage, read> tiles: array<vec4<u32>>;
@group(0) @binding(4) var<storage, read> table_x: array<f32>;
@group(0) @binding(5) var<storage, read> table_y: array<f32>;
@group(0) @binding(6) var<storage, read_write> plane: array<vec2<f32>>;

const TILE = 64u;
const BATCH = 8u;

// Kernels of a batch: sixteen times four columns, and rows, of each.
var<workgroup> x_re: array<array<vec4<f32>, 16>, 8>;
var<workgroup> x_im: array<array<vec4<f32>, 16>, 8>;
var<workgroup> y_re: array<array<vec4<f32>, 16>, 8>;
var<workgroup> y_im: array<array<vec4<f32>, 16>, 8>;

// Four-point Lagrange interpolation in depth.
fn lagrange(u: f32) -> vec4<f32> {
    return vec4(
        -u * (u - 1.0) * (u - 2.0) / 6.0,
        (u + 1.0) * (u - 1.0) * (u - 2.0) / 2.0,
        -(u + 1.0) * u * (u - 2.0) / 2.0,
        (u + 1.0) * u * (u - 1.0) / 6.0,
    );
}

fn kernel_x(s: Stroke, pixel: i32) -> vec2<f32> {
    let at = pixel - s.pixel.x + paint.middle.x;
    if (at < 0 || at >= i32(paint.row.x)) {
        return vec2(0.0);
    }
    let weights = lagrange(s.depth.x);
    let row = paint.row.x;
    var sum = vec2(0.0);
    for (var level = 0u; level < 4u; level++) {
        let i = (s.line.x + level * paint.lines.x) * 2u * row + u32(at);
        let near = vec2(table_x[i], table_x[i + row]);
        let far = vec2(table_x[i + 2u * row], table_x[i + 3u * row]);
        sum += weights[level] * (near * (1.0 - s.part.x) + far * s.part.x);
    }
    return vec2(sum.x, sum.y * s.sign);
}

fn kernel_y(s: Stroke, pixel: i32) -> vec2<f32> {
    let at = pixel - s.pixel.y + paint.middle.y;
    if (at < 0 || at >= i32(paint.row.y)) {
        return vec2(0.0);
    }
    let weights = lagrange(s.depth.y);
    let row = paint.row.y;
    var sum = vec2(0.0);
    for (var level = 0u; level < 4u; level++) {
        let i = (s.line.y + level * paint.lines.y) * 2u * row + u32(at);
        let near = vec2(table_y[i], table_y[i + row]);
        let far = vec2(table_y[i + 2u * row], table_y[i + 3u * row]);
        sum += weights[level] * (near * (1.0 - s.part.y) + far * s.part.y);
    }
    return vec2(sum.x, sum.y * s.sign);
}

fn add(column: u32, row: u32, re: vec4<f32>, im: vec4<f32>) {
    if (row >= paint.height) {
        return;
    }
    for (var i = 0u; i < 4u; i++) {
        if (column + i < paint.width) {
            let at = row * paint.width + column + i;
            plane[at] = plane[at] + vec2(re[i], im[i]);
        }
    }
}

// A workgroup adds a list of strokes to one tile: sixteen by sixteen threads of four by four pixels.
@compute @workgroup_size(256)
fn paint_tile(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) thread: u32) {
    let index = group.y * paint.across + group.x;
    if (index >= paint.count) {
        return;
    }
    let tile = tiles[index];
    let place = vec2(thread % 16u, thread / 16u);
    // 32 threads evaluate the kernels of a stroke: sixteen its columns, sixteen its rows.
    let mine = thread / 32u;
    let four = thread % 16u;
    let is_row = (thread / 16u) % 2u == 1u;
    var re0 = vec4(0.0);
    var re1 = vec4(0.0);
    var re2 = vec4(0.0);
    var re3 = vec4(0.0);
    var im0 = vec4(0.0);
    var im1 = vec4(0.0);
    var im2 = vec4(0.0);
    var im3 = vec4(0.0);
    for (var first = 0u; first < tile.w; first += BATCH) {
        let count = min(BATCH, tile.w - first);
        if (mine < count) {
            let s = strokes[lists[tile.z + first + mine]];
            if (is_row) {
                var factor = s.factor;
                for (var r = 0u; r < paint.moment; r++) {
                    factor *= s.ratio;
                }
                var re = vec4(0.0);
                var im = vec4(0.0);
                for (var i = 0u; i < 4u; i++) {
                    let g = kernel_y(s, i32(tile.y * TILE + 4u * four + i));
                    re[i] = g.x * factor.x - g.y * factor.y;
                    im[i] = g.x * factor.y + g.y * factor.x;
                }
                // Whole vectors: a store to a part of one may touch the rest.
                y_re[mine][four] = re;
                y_im[mine][four] = im;
            } else {
                var re = vec4(0.0);
                var im = vec4(0.0);
                for (var i = 0u; i < 4u; i++) {
                    let g = kernel_x(s, i32(tile.x * TILE + 4u * four + i));
                    re[i] = g.x;
                    im[i] = g.y;
                }
                x_re[mine][four] = re;
                x_im[mine][four] = im;
            }
        }
        workgroupBarrier();
        for (var k = 0u; k < count; k++) {
            let xr = x_re[k][place.x];
            let xi = x_im[k][place.x];
            let yr = y_re[k][place.y];
            let yi = y_im[k][place.y];
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
    let column = tile.x * TILE + 4u * place.x;
    let row = tile.y * TILE + 4u * place.y;
    add(column, row, re0, im0);
    add(column, row + 1u, re1, im1);
    add(column, row + 2u, re2, im2);
    add(column, row + 3u, re3, im3);
}

struct Carry {
    width: u32,
    height: u32,
    moment: u32,
    rank: u32,
    // ζ/λ and 2πh/λ.
    ratio: f32,
    kappa: f32,
    // A quarter of the x axis' mean square.
    slope: f32,
    // Largest a and b that are lit.
    limit_x: f32,
    limit_y: f32,
    unused0: u32,
    unused1: u32,
    unused2: u32,
}

@group(0) @binding(0) var<uniform> carry: Carry;
// a, √(1 − a), ζ·S(f_x) in turns, and the separable fit's part of x.
@group(0) @binding(1) var<storage, read> columns: array<vec4<f32>>;
// b, √(1 − b), ζ·(S(f_y) − 1/λ) in turns.
@group(0) @binding(2) var<storage, read> rows: array<vec4<f32>>;
@group(0) @binding(3) var<storage, read> transformed: array<vec2<f32>>;
@group(0) @binding(4) var<storage, read_write> sum: array<vec2<f32>>;

// exp(i2π·turns): the polynomials of the CPU's kernels, since a shading language promises a sine to 5e-4 only.
fn cis(turns: f32) -> vec2<f32> {
    let f = turns - round(turns);
    let w = f * f;
    var c = -21.071106;
    c = fma(c, w, 58.79049);
    c = fma(c, w, -85.27162);
    c = fma(c, w, 64.92866);
    c = fma(c, w, -19.73898);
    c = fma(c, w, 0.9999992);
    var s = -12.471244;
    s = fma(s, w, 41.34288);
    s = fma(s, w, -76.61447);
    s = fma(s, w, 81.599945);
    s = fma(s, w, -41.34159);
    s = fma(s, w, 6.2831855);
    return vec2(c, s * f);
}

fn series(w: f32, a: f32, b: f32, c: f32, d: f32) -> f32 {
    return fma(fma(fma(d, w, c), w, b), w, a);
}

// p_r(x) of the Legendre series over a slab, by the power series of (2l + 1)·j_l(x).
fn legendre(x: f32) -> f32 {
    let w = x * x;
    if (carry.moment == 1u) {
        let j1 = series(w, 1.0, -1.0 / 10.0, 1.0 / 280.0, -1.0 / 15120.0) * x;
        if (carry.rank < 4u) {
            return j1;
        }
        let j3 = series(w, 1.0 / 15.0, -1.0 / 270.0, 1.0 / 11880.0, -1.0 / 926640.0) * w * x;
        return fma(j3, 1.5, j1);
    }
    if (carry.moment == 3u) {
        return 2.5 * series(w, 1.0 / 15.0, -1.0 / 270.0, 1.0 / 11880.0, -1.0 / 926640.0) * w * x;
    }
    let j2 = series(w, 1.0 / 3.0, -1.0 / 42.0, 1.0 / 1512.0, -1.0 / 99792.0) * w;
    if (carry.moment == 2u) {
        return 1.5 * j2;
    }
    let j0 = series(w, 1.0, -1.0 / 6.0, 1.0 / 120.0, -1.0 / 5040.0);
    return select(j0, fma(j2, 0.5, j0), carry.rank > 2u);
}

// Adds the transform of a plane's moment to the spectrum on the panel.
@compute @workgroup_size(64)
fn add_plane(@builtin(global_invocation_id) id: vec3<u32>) {
    if (id.x >= carry.width || id.y >= carry.height) {
        return;
    }
    let column = columns[id.x];
    let row = rows[id.y];
    let a = column.x;
    let b = row.x;
    if (a > carry.limit_x || b > carry.limit_y) {
        return;
    }
    // C = λ(f_z − S(f_x) − S(f_y)) + 1 without cancellation.
    let root = sqrt(max(1.0 - a - b, 0.01));
    let over = 1.0 / (root + row.y) + 1.0 / (1.0 + column.y);
    let c = -a * b * over / ((1.0 + row.y) * (root + column.y));
    let x = (c + column.w + b * carry.slope) * carry.kappa;
    // i^r is a quarter turn a moment.
    let phase = cis(c * carry.ratio + (row.z + column.z) + 0.25 * f32(carry.moment));
    let h = phase * (column.y * row.y / root * legendre(x));
    let at = id.y * carry.width + id.x;
    let u = transformed[at];
    sum[at] = sum[at] + vec2(h.x * u.x - h.y * u.y, h.x * u.y + h.y * u.x);
}

struct Window {
    width: u32,
    height: u32,
    // Size of the panel, and where its first pixel stands on the periodic grid.
    columns: u32,
    rows: u32,
    first_column: u32,
    first_row: u32,
    scale: f32,
    unused: u32,
}

@group(0) @binding(0) var<uniform> view: Window;
@group(0) @binding(1) var<storage, read> periodic: array<vec2<f32>>;
@group(0) @binding(2) var<storage, read_write> panel: array<vec2<f32>>;

@compute @workgroup_size(64)
fn cut_window(@builtin(global_invocation_id) id: vec3<u32>) {
    if (id.x >= view.columns || id.y >= view.rows) {
        return;
    }
    let column = (id.x + view.first_column) % view.width;
    let row = (id.y + view.first_row) % view.height;
    panel[id.y * view.columns + id.x] = periodic[row * view.width + column] * view.scale;
}
