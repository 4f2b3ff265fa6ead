#include "render/tile_decode.h"

#include <assert.h>
#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "render/mapped_buffer.h"
#include "render/program.h"

#define BATCHES 3 /* one is written while the GPU reads others */

/* As tile_decode.comp has it. */
struct gpu_job {
    GLint slot, parent_slot, row0, col0; /* the latter two of the parent: the tile's first post */
    GLint word, runs, same_columns, unused;
    GLdouble parent_step[2];
};
static_assert(sizeof(struct gpu_job) == 48, "as in tile_decode.comp");

/* The last dispatches, counted from 1, that touched a slot. */
struct slot_use {
    unsigned written, read;
};

struct tile_decode {
    GLuint program, tiles;
    struct mapped_buffer jobs, words; /* BATCHES parts */
    GLsync fences[BATCHES];           /* after which the GPU is done with a part */
    struct slot_use *uses;            /* [slots] */
    uint32_t slots;
    size_t words_most;                         /* of a batch */
    struct gpu_job pending[TILE_DECODE_BATCH]; /* of the batch that is being added to */
    unsigned batch, job_count, dispatch;
    size_t word_count;
};

static int create_tiles(struct tile_decode *decode, struct diag *diag)
{
    GLint most = 0;
    glGetIntegerv(GL_MAX_ARRAY_TEXTURE_LAYERS, &most);
    if (decode->slots > (uint32_t)most)
        return diag_set(diag, -EINVAL, "%u tiles in GPU memory are asked for, it can have %d",
                        decode->slots, most);
    glCreateTextures(GL_TEXTURE_2D_ARRAY, 1, &decode->tiles);
    glTextureStorage3D(decode->tiles, 1, GL_R32I, TILE_POSTS, TILE_POSTS, (GLsizei)decode->slots);
    glTextureParameteri(decode->tiles, GL_TEXTURE_MIN_FILTER, GL_NEAREST);
    glTextureParameteri(decode->tiles, GL_TEXTURE_MAG_FILTER, GL_NEAREST);
    if (glGetError() == GL_OUT_OF_MEMORY)
        return diag_set(diag, -ENOMEM, "no GPU memory for %u tiles", decode->slots);
    return 0;
}

int tile_decode_create(uint32_t slots, size_t batch_bytes, struct tile_decode **ret_decode,
                       struct diag *diag)
{
    const struct program_params params = {.name = "tile_decode"};
    struct tile_decode *decode = calloc(1, sizeof(*decode));
    if (!decode)
        return diag_set(diag, -ENOMEM, "no memory for tiles");
    *decode = (struct tile_decode){.slots = slots, .words_most = batch_bytes / sizeof(GLuint)};
    assert(decode->words_most >= TILE_RESIDUAL_WORDS_MOST);
    decode->uses = calloc(slots, sizeof(*decode->uses));
    int r = program_create(&params, &decode->program, diag);
    if (r == 0)
        r = create_tiles(decode, diag);
    if (r == 0 && (!decode->uses ||
                   mapped_buffer_create(&decode->jobs, TILE_DECODE_BATCH * sizeof(struct gpu_job),
                                        BATCHES, false) < 0 ||
                   mapped_buffer_create(&decode->words, batch_bytes, BATCHES, true) < 0))
        r = diag_set(diag, -ENOMEM, "no memory for the residuals of tiles");
    if (r < 0) {
        tile_decode_destroy(decode);
        return r;
    }
    *ret_decode = decode;
    return 0;
}

void tile_decode_destroy(struct tile_decode *decode)
{
    if (!decode)
        return;
    for (int i = 0; i < BATCHES; i++)
        glDeleteSync(decode->fences[i]);
    mapped_buffer_destroy(&decode->jobs);
    mapped_buffer_destroy(&decode->words);
    glDeleteTextures(1, &decode->tiles);
    glDeleteProgram(decode->program);
    free(decode->uses);
    free(decode);
}

/* Whether the GPU is done with the memory of the batch. */
static bool is_free(struct tile_decode *decode)
{
    GLsync *fence = &decode->fences[decode->batch];
    GLenum state =
        *fence ? glClientWaitSync(*fence, GL_SYNC_FLUSH_COMMANDS_BIT, 0) : GL_ALREADY_SIGNALED;
    if (state != GL_ALREADY_SIGNALED && state != GL_CONDITION_SATISFIED)
        return false;
    glDeleteSync(*fence);
    *fence = NULL;
    return true;
}

bool tile_decode_add(struct tile_decode *decode, const struct tile_decode_job *job)
{
    bool root = job->parent_slot == TILE_DECODE_NO_PARENT;
    assert(job->slot < decode->slots && (root || job->parent_slot < decode->slots));
    assert(job->slot != job->parent_slot);
    if (decode->job_count == TILE_DECODE_BATCH || !is_free(decode) ||
        decode->word_count + job->word_count > decode->words_most)
        return false;
    GLuint *words = mapped_buffer_part(&decode->words, decode->batch);
    memcpy(words + decode->word_count, job->words, job->word_count * sizeof(*words));
    decode->pending[decode->job_count++] = (struct gpu_job){
        .slot = (GLint)job->slot,
        .parent_slot = root ? -1 : (GLint)job->parent_slot,
        .row0 = job->place.row_half * (TILE_CELLS / 2),
        .col0 = job->place.col_half * (TILE_CELLS / 2),
        .word = (GLint)decode->word_count,
        .runs = tile_residual_runs(root ? NULL : &job->place),
        .same_columns = job->place.same_columns,
        .parent_step = {job->parent_step_m},
    };
    decode->word_count += job->word_count;
    return true;
}

/* Whether a tile has to wait for what the dispatch before it does. */
static bool has_to_wait(const struct tile_decode *decode, const struct gpu_job *job)
{
    const struct slot_use *own = &decode->uses[job->slot];
    return own->written == decode->dispatch || own->read == decode->dispatch ||
           (job->parent_slot >= 0 && decode->uses[job->parent_slot].written == decode->dispatch);
}

static void rebuild(struct tile_decode *decode, unsigned first, unsigned end)
{
    glUniform1i(0, (GLint)first);
    glDispatchCompute(end - first, 1, 1);
    glMemoryBarrier(GL_SHADER_IMAGE_ACCESS_BARRIER_BIT);
    decode->dispatch++;
}

void tile_decode_run(struct tile_decode *decode)
{
    const struct gpu_job *jobs = decode->pending;
    unsigned first = 0;
    if (decode->job_count == 0)
        return;
    memcpy(mapped_buffer_part(&decode->jobs, decode->batch), jobs,
           decode->job_count * sizeof(*jobs));
    glUseProgram(decode->program);
    glBindImageTexture(0, decode->tiles, 0, GL_TRUE, 0, GL_READ_WRITE, GL_R32I);
    mapped_buffer_bind(&decode->words, GL_SHADER_STORAGE_BUFFER, 0, decode->batch,
                       decode->words.stride);
    mapped_buffer_bind(&decode->jobs, GL_SHADER_STORAGE_BUFFER, 1, decode->batch,
                       decode->jobs.stride);
    decode->dispatch++;
    for (unsigned i = 0; i < decode->job_count; i++) {
        if (has_to_wait(decode, &jobs[i])) {
            rebuild(decode, first, i);
            first = i;
        }
        decode->uses[jobs[i].slot].written = decode->dispatch;
        if (jobs[i].parent_slot >= 0)
            decode->uses[jobs[i].parent_slot].read = decode->dispatch;
    }
    rebuild(decode, first, decode->job_count);
    glMemoryBarrier(GL_TEXTURE_FETCH_BARRIER_BIT | GL_TEXTURE_UPDATE_BARRIER_BIT);
    decode->fences[decode->batch] = glFenceSync(GL_SYNC_GPU_COMMANDS_COMPLETE, 0);
    decode->batch = (decode->batch + 1) % BATCHES;
    decode->job_count = 0;
    decode->word_count = 0;
}

GLuint tile_decode_texture(const struct tile_decode *decode)
{
    return decode->tiles;
}

size_t tile_decode_bytes_of(const struct tile_decode_job *job)
{
    return sizeof(struct gpu_job) + job->word_count * sizeof(GLuint);
}
