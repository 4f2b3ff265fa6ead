// Rebuilds tiles from their residuals (terrain/tile_residual.h), a work group a tile. All arithmetic
// is on whole numbers modulo 2^32, as on the CPU.
layout(local_size_x = 256) in;

const int POSTS = 129, NONE = -0x7fffffff - 1;
const int RUN = 32, RUNS_MOST = 521, RUNS_A_THREAD = 3, HOLES = 0x80;

struct Job {
    ivec4 place;      // layer; the parent's, or -1; of the parent: the row and column of the tile's first
    ivec4 words;      // the first; runs; 1 where the columns are the parent's, else 0
    dvec2 parent_step; // x: 0, or metres of the parent's symbols, which are wanted as bits of heights
};
layout(r32i, binding = 0) uniform iimage2DArray tiles;
layout(std430, binding = 0) readonly buffer Words { uint words[]; };
layout(std430, binding = 1) readonly buffer Jobs { Job jobs[]; };
layout(location = 0) uniform int first_job;

shared uint sums[256];
shared uint begins[RUNS_MOST]; // words before a run's, counted from the first run's
Job job;

uint byte_of(int run)
{
    return words[job.words.x + 1 + run / 4] >> (run % 4 * 8) & 0xffu;
}

void find_runs()
{
    int thread = int(gl_LocalInvocationID.x), first = thread * RUNS_A_THREAD;
    uint own = 0u;
    for (int run = first; run < min(first + RUNS_A_THREAD, job.words.y); run++)
        own += byte_of(run) & 0x7fu;
    sums[thread] = own;
    for (int step = 1; step < 256; step *= 2) {
        barrier();
        uint before = thread >= step ? sums[thread - step] : 0u;
        barrier();
        sums[thread] += before;
    }
    uint begin = sums[thread] - own;
    for (int run = first; run < min(first + RUNS_A_THREAD, job.words.y); run++) {
        begins[run] = begin;
        begin += byte_of(run) & 0x7fu;
    }
    barrier();
}

// A height's bits in the order of the heights: what a symbol is where the step is 0.
int bits_of(int symbol)
{
    int bits = floatBitsToInt(float(double(symbol) * job.parent_step.x));
    return bits < 0 ? -(bits & 0x7fffffff) : bits;
}

int parent_post(int row, int col)
{
    if (uint(row) >= uint(POSTS) || uint(col) >= uint(POSTS))
        return NONE;
    int symbol = imageLoad(tiles, ivec3(col, row, job.place.y)).x;
    return symbol != NONE && job.parent_step.x != 0.0 ? bits_of(symbol) : symbol;
}

int between(int c, int a, int b, int d)
{
    if (a == NONE)
        return b;
    if (b == NONE)
        return a;
    int rise = b - a;
    int before = c == NONE ? rise : a - c, after = d == NONE ? rise : d - b;
    return a + ((8 * rise + before - after + 8) >> 4);
}

int along_row(int row, int col)
{
    if (job.words.z != 0)
        return parent_post(row, col);
    int at = job.place.w + col / 2;
    if (col % 2 == 0)
        return parent_post(row, at);
    return between(parent_post(row, at - 1), parent_post(row, at), parent_post(row, at + 1),
                   parent_post(row, at + 2));
}

int predict(int row, int col)
{
    if (job.place.y < 0)
        return NONE;
    int at = job.place.z + row / 2;
    if (row % 2 == 0)
        return along_row(at, col);
    return between(along_row(at - 1, col), along_row(at, col), along_row(at + 1, col),
                   along_row(at + 2, col));
}

// The place of a post among those in the words; -1 where it is the parent's.
int place_of(int row, int col)
{
    if (job.place.y < 0)
        return row * POSTS + col;
    if (row % 2 == 1)
        return row / 2 * (job.words.z != 0 ? POSTS : POSTS + 64) + (job.words.z != 0 ? 0 : 64) + col;
    return job.words.z != 0 || col % 2 == 0 ? -1 : row / 2 * (POSTS + 64) + col / 2;
}

int symbol_at(int place, int predicted)
{
    int run = place / RUN, width = int(byte_of(run) & 0x7fu);
    uint begin = uint(job.words.x + 1 + (job.words.y + 3) / 4) + begins[run], bits = 0u;
    if (width > 0) {
        int at = place % RUN * width, shift = at % 32;
        bits = words[begin + uint(at / 32)] >> shift;
        if (shift + width > 32)
            bits |= words[begin + uint(at / 32) + 1u] << (32 - shift);
    }
    if (width == 32)
        return int(bits);
    bits &= (1u << width) - 1u;
    if (bits == 0u && (byte_of(run) & uint(HOLES)) != 0u)
        return NONE;
    return int(uint(predicted) + bits - (width > 0 ? 1u << (width - 1) : 0u));
}

void main()
{
    job = jobs[first_job + int(gl_WorkGroupID.x)];
    find_runs();
    for (int i = int(gl_LocalInvocationID.x); i < POSTS * POSTS; i += 256) {
        int row = i / POSTS, col = i % POSTS, place = place_of(row, col);
        int symbol = predict(row, col);
        if (place >= 0)
            symbol = symbol_at(place, symbol == NONE ? int(words[job.words.x]) : symbol);
        imageStore(tiles, ivec3(col, row, job.place.x), ivec4(symbol));
    }
}
