#include "render/image_pass.h"

#include <epoxy/gl.h>
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "geo/cube.h"
#include "geo/frames.h"
#include "render/mapped_buffer.h"
#include "render/program.h"
#include "terrain/imagery.h"

#define WGS84_A         6378137.0
#define BUFFERED_FRAMES 4
#define UPLOAD_GROUP    64   /* texels of a work group of image_upload.comp */
#define PIXEL_RAD       1e-3 /* until a view is known */

/* A finer level ends within this share of what the coarser one holds; while the two lie on
 * different planes, it may be turned against it and its texels larger. */
#define INSIDE_COARSER 0.8
#define INSIDE_TURNED  0.5

enum { TEXTURE_COLOUR = 4, TEXTURE_WATER = 5, BLOCK_IMAGES = 1 };

/* The uniform block `Images` of images.glsl (std140). */
struct images_plane {
    float along[4], across[4], toward[4];
};

struct images_block {
    float range[4];
    int32_t split[4];
    struct images_plane planes[2];
    float levels[IMAGE_CLIPMAP_LEVELS_MAX][4];
};

_Static_assert(offsetof(struct images_block, levels) == 128, "std140");

struct image_pass {
    struct image_shape shape;
    struct image_loader *loader;
    char defines[64];
    GLuint upload, colours, waters;
    struct mapped_buffer arenas; /* IMAGE_UPDATES parts, which the loader writes */
    size_t water_offset;
    struct mapped_buffer blocks; /* BUFFERED_FRAMES parts */
    unsigned block;
    struct image_layout layout; /* of the last update */
    double pixel_rad;           /* of the last view */
    struct image_update *next;  /* taken, but too much for the last frame */
    struct image_update *held[IMAGE_UPDATES];
    unsigned held_count;
};

/* One layer more than levels: the loader's spare. */
static GLuint create_array(const struct image_shape *shape, GLenum format)
{
    GLuint texture = 0;
    glCreateTextures(GL_TEXTURE_2D_ARRAY, 1, &texture);
    glTextureStorage3D(texture, 1, format, shape->side, shape->side, shape->levels + 1);
    glTextureParameteri(texture, GL_TEXTURE_MIN_FILTER, GL_LINEAR);
    glTextureParameteri(texture, GL_TEXTURE_MAG_FILTER, GL_LINEAR);
    glTextureParameteri(texture, GL_TEXTURE_WRAP_S, GL_REPEAT);
    glTextureParameteri(texture, GL_TEXTURE_WRAP_T, GL_REPEAT);
    return texture;
}

static int create_buffers(struct image_pass *pass, struct image_loader_params *params)
{
    size_t arena = image_loader_arena_bytes(params);
    int r = mapped_buffer_create(&pass->arenas, arena, IMAGE_UPDATES, true);
    if (r == 0)
        r = mapped_buffer_create(&pass->blocks, sizeof(struct images_block), BUFFERED_FRAMES,
                                 false);
    for (unsigned i = 0; r == 0 && i < IMAGE_UPDATES; i++)
        params->arenas[i] = mapped_buffer_part(&pass->arenas, i);
    return r;
}

/* All but the loader. */
static int create_storage(struct image_pass *pass, struct image_loader_params *params,
                          struct diag *diag)
{
    pass->shape = params->shape;
    pass->pixel_rad = PIXEL_RAD;
    pass->water_offset = image_loader_water_offset(params);
    snprintf(pass->defines, sizeof(pass->defines), "#define COLOUR %d\n#define WATER %d\n",
             params->colour, params->water);
    int r =
        program_create(&(struct program_params){.name = "image_upload", .defines = pass->defines},
                       &pass->upload, diag);
    if (r < 0)
        return r;
    if (params->colour)
        pass->colours = create_array(&pass->shape, GL_RGBA8);
    if (params->water)
        pass->waters = create_array(&pass->shape, GL_RG8);
    r = create_buffers(pass, params);
    if (r < 0 || glGetError() == GL_OUT_OF_MEMORY)
        return diag_set(diag, -ENOMEM, "no GPU memory for imagery: %d levels of %d x %d texels",
                        pass->shape.levels, pass->shape.side, pass->shape.side);
    return 0;
}

int image_pass_create(struct imagery *imagery, int width_px, struct image_pass **ret_pass,
                      struct diag *diag)
{
    struct imagery_facts facts;
    imagery_get_facts(imagery, &facts);
    struct image_loader_params params = {
        .shape = image_clipmap_shape(facts.finest_texel_deg, width_px),
        .colour = facts.has_colour,
        .water = facts.has_water,
        .imagery = imagery,
    };
    struct image_pass *pass = calloc(1, sizeof(*pass));
    int r = pass ? create_storage(pass, &params, diag)
                 : diag_set(diag, -ENOMEM, "no memory for the imagery");
    if (r < 0)
        imagery_close(imagery);
    else
        r = image_loader_start(&params, &pass->loader, diag);
    if (r < 0) {
        image_pass_destroy(pass);
        return r;
    }
    *ret_pass = pass;
    return 0;
}

void image_pass_destroy(struct image_pass *pass)
{
    if (!pass)
        return;
    image_loader_stop(pass->loader);
    glDeleteProgram(pass->upload);
    glDeleteTextures(1, &pass->colours);
    glDeleteTextures(1, &pass->waters);
    mapped_buffer_destroy(&pass->blocks);
    mapped_buffer_destroy(&pass->arenas);
    free(pass);
}

const char *image_pass_defines(const struct image_pass *pass)
{
    return pass ? pass->defines : "#define COLOUR 0\n#define WATER 0\n";
}

static int finest_level(const struct image_pass *pass, double height_m)
{
    return image_clipmap_finest(&pass->shape, height_m, pass->pixel_rad);
}

/* One level finer than is drawn is kept ready, so that descending finds it. */
void image_pass_wish(struct image_pass *pass, const struct geodetic *eye, double height_m)
{
    if (!pass)
        return;
    int finest = finest_level(pass, height_m);
    image_loader_wish(pass->loader, eye->lat_deg, eye->lon_deg, finest > 0 ? finest - 1 : 0);
}

static void upload(const struct image_pass *pass, const struct image_update *update)
{
    GLint texels = update->rows * update->cols;
    glUseProgram(pass->upload);
    mapped_buffer_bind(&pass->arenas, GL_SHADER_STORAGE_BUFFER, 0, (unsigned)update->slot,
                       pass->arenas.stride);
    if (pass->colours)
        glBindImageTexture(0, pass->colours, 0, GL_TRUE, 0, GL_WRITE_ONLY, GL_RGBA8);
    if (pass->waters)
        glBindImageTexture(1, pass->waters, 0, GL_TRUE, 0, GL_WRITE_ONLY, GL_RG8);
    glUniform4i(0, update->col, update->row, update->cols, texels);
    glUniform3i(1, update->layer, pass->shape.side - 1,
                (GLint)(pass->water_offset / sizeof(GLuint)));
    glDispatchCompute((GLuint)(texels + UPLOAD_GROUP - 1) / UPLOAD_GROUP, 1, 1);
}

/* The next strip: the one that was left over, or from the loader. */
static struct image_update *next_update(struct image_pass *pass)
{
    if (!pass->next)
        pass->next = image_loader_take(pass->loader);
    return pass->next;
}

void image_pass_settle(struct image_pass *pass)
{
    while (pass && (pass->next || image_loader_wait(pass->loader))) {
        struct image_update *update = next_update(pass);
        upload(pass, update);
        pass->layout = update->layout;
        glMemoryBarrier(GL_TEXTURE_FETCH_BARRIER_BIT);
        glFinish();
        image_loader_give_back(pass->loader, update);
        pass->next = NULL;
    }
}

static size_t bytes_of(const struct image_pass *pass, const struct image_update *update)
{
    size_t texels = (size_t)update->rows * (size_t)update->cols;
    return texels * sizeof(GLuint) * ((pass->colours != 0) + (pass->waters != 0));
}

size_t image_pass_take(struct image_pass *pass, size_t most_bytes)
{
    size_t bytes = 0;
    struct image_update *update;
    while (pass && pass->held_count < IMAGE_UPDATES && (update = next_update(pass)) &&
           bytes + bytes_of(pass, update) <= most_bytes) {
        bytes += bytes_of(pass, update);
        pass->layout = update->layout;
        pass->held[pass->held_count++] = update;
        pass->next = NULL;
    }
    return bytes;
}

void image_pass_upload(struct image_pass *pass)
{
    if (!pass || pass->held_count == 0)
        return;
    for (unsigned i = 0; i < pass->held_count; i++)
        upload(pass, pass->held[i]);
    glMemoryBarrier(GL_TEXTURE_FETCH_BARRIER_BIT);
}

bool image_pass_complete(const struct image_pass *pass, const struct geodetic *eye, double height_m)
{
    double normal[3];
    if (!pass)
        return true;
    cube_normal_from_geodetic(eye->lat_deg, eye->lon_deg, normal);
    for (int level = finest_level(pass, height_m); level < pass->shape.levels; level++)
        if (image_clipmap_held(&pass->shape, level, &pass->layout.windows[level], normal) <
            image_clipmap_reach(&pass->shape))
            return false;
    return true;
}

/* A place as a fraction of the toroidal storage's side, 0 .. 1, of the centre of its texel. */
static float storage_place(double texel, int side)
{
    double sides = (texel + 0.5) / side;
    return (float)(sides - floor(sides));
}

/* A plane as the eye sees it; offsets from there are in sides of level 0. */
static void set_plane(const struct image_shape *shape, int plane, const double enu_axes[3][3],
                      struct images_plane *ret_plane)
{
    double axes[3][3], enu[3][3];
    image_plane_axes(plane, axes);
    for (int i = 0; i < 3; i++)
        frames_rotate(enu_axes, axes[i], enu[i]);
    double toward = enu[0][2], scale = 1.0 / (toward * shape->step_rad * shape->side);
    for (int i = 0; i < 3; i++) {
        ret_plane->along[i] = (float)(scale * (enu[1][i] - enu[1][2] / toward * enu[0][i]));
        ret_plane->across[i] = (float)(scale * (enu[2][i] - enu[2][2] / toward * enu[0][i]));
        ret_plane->toward[i] = (float)(enu[0][i] / toward);
    }
}

/* Where the eye is on a level, and how far from there it is drawn, at most `most` texels; returns
 * that. */
static double set_level(const struct image_pass *pass, int level, const double normal[3],
                        double most, float ret_level[4])
{
    const struct image_window *window = &pass->layout.windows[level];
    double side = pass->shape.side, row = 0.0, col = 0.0;
    double reach = fmin(image_clipmap_held(&pass->shape, level, window, normal), most);
    if (reach > 0.0)
        image_clipmap_texel(&pass->shape, level, window->plane, normal, &row, &col);
    ret_level[0] = storage_place(col, pass->shape.side);
    ret_level[1] = storage_place(row, pass->shape.side);
    ret_level[2] = (float)(reach / side);
    ret_level[3] = (float)pass->layout.layers[level];
    return reach;
}

/* All levels; those below the first whose plane is another have that, and where there is a third
 * one, after a jump, they are not drawn. */
static void set_levels(const struct image_pass *pass, const double normal[3],
                       const double enu_axes[3][3], struct images_block *block)
{
    int planes[2] = {0, 0}, levels = pass->shape.levels, split = 0;
    double most = pass->shape.side;
    for (int level = levels - 1; level >= 0; level--) {
        int plane = pass->layout.windows[level].plane, which = planes[1] != 0;
        if (plane && plane != planes[which]) {
            which += planes[which] != 0;
            split = which ? level + 1 : 0;
            most *= which ? INSIDE_TURNED : 1.0;
            if (which < 2)
                planes[which] = plane;
        }
        double reach = set_level(pass, level, normal, which < 2 ? most : 0.0, block->levels[level]);
        most = 2.0 * INSIDE_COARSER * reach;
    }
    for (int i = 0; i < 2; i++)
        if (planes[i])
            set_plane(&pass->shape, planes[i], enu_axes, &block->planes[i]);
    block->split[0] = split;
}

void image_pass_prepare(struct image_pass *pass, const struct geodetic *eye, double height_m,
                        double pixel_rad)
{
    if (!pass)
        return;
    const struct image_shape *shape = &pass->shape;
    double normal[3], enu_axes[3][3];
    cube_normal_from_geodetic(eye->lat_deg, eye->lon_deg, normal);
    frames_enu_axes_ecef(eye->lat_deg, eye->lon_deg, enu_axes);
    pass->pixel_rad = pixel_rad;
    pass->block = (pass->block + 1) % BUFFERED_FRAMES;
    struct images_block *block = mapped_buffer_part(&pass->blocks, pass->block);
    block->range[0] = (float)finest_level(pass, height_m);
    block->range[1] = (float)(shape->levels - 1);
    block->range[2] = (float)(pixel_rad / WGS84_A);
    block->range[3] = (float)shape->side;
    set_levels(pass, normal, enu_axes, block);
}

void image_pass_bind(const struct image_pass *pass)
{
    if (!pass)
        return;
    mapped_buffer_bind(&pass->blocks, GL_UNIFORM_BUFFER, BLOCK_IMAGES, pass->block,
                       sizeof(struct images_block));
    glBindTextureUnit(TEXTURE_COLOUR, pass->colours);
    glBindTextureUnit(TEXTURE_WATER, pass->waters);
}

void image_pass_release(struct image_pass *pass)
{
    while (pass && pass->held_count > 0)
        image_loader_give_back(pass->loader, pass->held[--pass->held_count]);
}

void image_pass_counts(const struct image_pass *pass, struct image_loader_counts *ret_counts)
{
    *ret_counts = (struct image_loader_counts){0};
    if (pass)
        image_loader_counts(pass->loader, ret_counts);
}
