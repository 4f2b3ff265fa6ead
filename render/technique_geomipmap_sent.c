#include "render/technique_geomipmap_sent.h"

#include <errno.h>
#include <stdbool.h>
#include <stdlib.h>

#include "render/technique_geomipmap_errors.h"

struct edge {
    int start[2], along[2];
    int factor;
};

static float share_of(int factor)
{
    return (float)(factor % PATCH_FACTOR) / (float)PATCH_FACTOR;
}

static float mix(float a, float b, float share)
{
    return a + share * (b - a);
}

static bool is_on_edge(int x, int y)
{
    return x % PATCH_CELLS == 0 || y % PATCH_CELLS == 0;
}

static struct edge edge_at(const struct patch_instance *patch, int x, int y)
{
    if (x % PATCH_CELLS == 0)
        return (struct edge){{patch->col + x, patch->row}, {0, 1}, patch->beside[x ? 1 : 0]};
    return (struct edge){{patch->col, patch->row + y}, {1, 0}, patch->beside[y ? 3 : 2]};
}

static float edge_field_m(const struct field *field, const struct edge *edge, int at)
{
    return field_height_m(field, edge->start[0] + at * edge->along[0],
                          edge->start[1] + at * edge->along[1]);
}

/* Of a post that the edge's level has: every second one morphs. */
static float edge_post_m(const struct field *field, const struct edge *edge, int at)
{
    int spacing = 1 << (edge->factor / PATCH_FACTOR);
    float height_m = edge_field_m(field, edge, at), share = share_of(edge->factor);
    if ((at & spacing) == 0 || share == 0.0f)
        return height_m;
    return mix(
        height_m,
        0.5f * (edge_field_m(field, edge, at - spacing) + edge_field_m(field, edge, at + spacing)),
        share);
}

/* Of any place of the edge. */
static float edge_m(const struct field *field, const struct edge *edge, int at)
{
    int spacing = 1 << (edge->factor / PATCH_FACTOR), before = at & ~(spacing - 1);
    float height_m = edge_post_m(field, edge, before);
    return at == before ? height_m
                        : mix(height_m, edge_post_m(field, edge, before + spacing),
                              (float)(at - before) / (float)spacing);
}

/* Of a post that the next coarser level has: it is still, but on an edge. */
static float coarse_m(const struct field *field, const struct patch_instance *patch, int x, int y)
{
    if (!is_on_edge(x, y))
        return field_height_m(field, patch->col + x, patch->row + y);
    struct edge edge = edge_at(patch, x, y);
    return edge_m(field, &edge, edge.along[0] ? x : y);
}

/* Every second post moves towards the middle of the two that stay, wherever an edge takes these. */
static float inner_m(const struct field *field, const struct patch_instance *patch, int x, int y)
{
    int level = patch->factor / PATCH_FACTOR, col = patch->col + x, row = patch->row + y;
    int odd_x = x >> level & 1, odd_y = y >> level & 1;
    float height_m = field_height_m(field, col, row), share = share_of(patch->factor);
    if ((!odd_x && !odd_y) || share == 0.0f)
        return height_m;
    bool falls = odd_x && odd_y && ((col >> (level + 1) ^ row >> (level + 1)) & 1) != 0;
    int away_x = odd_x << level, away_y = (falls ? -odd_y : odd_y) * (1 << level);
    return mix(height_m,
               0.5f * (coarse_m(field, patch, x - away_x, y - away_y) +
                       coarse_m(field, patch, x + away_x, y + away_y)),
               share);
}

static struct patch_vertex vertex_at(const struct field *field, const struct patch_instance *patch,
                                     int x, int y)
{
    if (!is_on_edge(x, y))
        return (struct patch_vertex){{(uint16_t)(patch->col + x), (uint16_t)(patch->row + y)},
                                     inner_m(field, patch, x, y)};
    /* what the edge's level leaves out falls onto the nearest post that it has */
    struct edge edge = edge_at(patch, x, y);
    int spacing = 1 << (edge.factor / PATCH_FACTOR), place = edge.along[0] ? x : y;
    place = (place + (spacing >> 1)) & ~(spacing - 1);
    return (struct patch_vertex){{(uint16_t)(edge.start[0] + place * edge.along[0]),
                                  (uint16_t)(edge.start[1] + place * edge.along[1])},
                                 edge_post_m(field, &edge, place)};
}

struct patch_vertex *patch_morph(const struct field *field, const struct patch_instance *patch,
                                 struct patch_vertex *ret_vertices)
{
    int step = 1 << (patch->factor / PATCH_FACTOR);
    for (int y = 0; y <= PATCH_CELLS; y += step)
        for (int x = 0; x <= PATCH_CELLS; x += step)
            *ret_vertices++ = vertex_at(field, patch, x, y);
    return ret_vertices;
}

int patch_stream_create(size_t patches, struct patch_stream *ret_stream)
{
    *ret_stream = (struct patch_stream){
        .first_vertices = malloc(patches * sizeof(*ret_stream->first_vertices)),
        .counts = malloc(patches * sizeof(*ret_stream->counts)),
        .offsets = malloc(patches * sizeof(*ret_stream->offsets)),
    };
    if (!ret_stream->first_vertices || !ret_stream->counts || !ret_stream->offsets)
        return -ENOMEM;
    glCreateBuffers(1, &ret_stream->buffer);
    return 0;
}

void patch_stream_destroy(struct patch_stream *stream)
{
    glDeleteBuffers(1, &stream->buffer);
    free(stream->first_vertices);
    free(stream->counts);
    free(stream->offsets);
    *stream = (struct patch_stream){0};
}

static size_t vertices_of(const struct patch_instance *patch)
{
    size_t side = (PATCH_CELLS >> (patch->factor / PATCH_FACTOR)) + 1;
    return side * side;
}

void patch_stream_send(struct patch_stream *stream, const struct field *field,
                       const struct patch_instance *patches, int count)
{
    stream->vertices = 0;
    for (int i = 0; i < count; i++) {
        stream->first_vertices[i] = (GLint)stream->vertices;
        stream->vertices += vertices_of(&patches[i]);
    }
    if (count == 0)
        return;
    GLsizeiptr bytes = (GLsizeiptr)(stream->vertices * sizeof(struct patch_vertex));
    glNamedBufferData(stream->buffer, bytes, NULL, GL_STREAM_DRAW);
    struct patch_vertex *to = glMapNamedBufferRange(
        stream->buffer, 0, bytes, GL_MAP_WRITE_BIT | GL_MAP_INVALIDATE_BUFFER_BIT);
    for (int i = 0; to && i < count; i++)
        to = patch_morph(field, &patches[i], to);
    if (!to || !glUnmapNamedBuffer(stream->buffer))
        stream->vertices = 0;
}

void patch_stream_draw(struct patch_stream *stream, int first, int patches, GLsizei list_count,
                       GLintptr list_offset)
{
    if (stream->vertices == 0)
        return;
    for (int i = first; i < first + patches; i++) {
        stream->counts[i] = list_count;
        stream->offsets[i] = (const void *)list_offset;
    }
    glMultiDrawElementsBaseVertex(GL_TRIANGLES, &stream->counts[first], GL_UNSIGNED_SHORT,
                                  &stream->offsets[first], patches, &stream->first_vertices[first]);
}

size_t patch_stream_cpu_bytes(size_t patches)
{
    return patches * (sizeof(GLint) + sizeof(GLsizei) + sizeof(void *));
}
