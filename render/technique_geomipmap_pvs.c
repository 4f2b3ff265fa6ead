#include "render/technique_geomipmap_pvs.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>

#include "terrain/parallel.h"

#define SLACK    0.25  /* squares: that straight lines are off in terms of rows and columns */
#define WIDE_RAD 0.026 /* of a field, at most, for that */

struct making {
    const struct field_box *boxes;
    struct pvs *pvs;
};

/* The lowest ground of squares along the minor axis, at `major` on the other. */
static float lowest_across(const struct making *making, bool swapped, int major, double from,
                           double to)
{
    int along = making->pvs->along, first = (int)fmax(floor(from), 0.0);
    int last = (int)fmin(floor(to), along - 1.0);
    float lowest_m = INFINITY;
    for (int minor = first; minor <= last; minor++) {
        int square = swapped ? minor * along + major : major * along + minor;
        lowest_m = fminf(lowest_m, making->boxes[square].least_m[2]);
    }
    return lowest_m;
}

/* Below which height no point of one square sees the highest of another: lines between them pass
 * the middle of each square between at a share t of their length. Places are (minor, major). */
static double hidden_below_m(const struct making *making, bool swapped, const int from[2],
                             const int of[2], double top_m)
{
    int way = of[1] > from[1] ? 1 : -1, far = abs(of[1] - from[1]);
    double hidden_m = -INFINITY, rise = of[0] - from[0];
    for (int i = 1; i < far; i++) {
        double least = (i - 0.5 - SLACK) / (far + SLACK), most = (i + 0.5 + SLACK) / (far - SLACK);
        double low = from[0] + fmin(least * rise, most * rise) - SLACK;
        double high = from[0] + 1.0 + fmax(least * rise, most * rise) + SLACK;
        double ground_m = (double)lowest_across(making, swapped, from[1] + way * i, low, high);
        if (most >= 1.0 || ground_m <= hidden_m)
            continue;
        double below_m = fmin((ground_m - top_m * least) / (1.0 - least),
                              (ground_m - top_m * most) / (1.0 - most));
        hidden_m = fmax(hidden_m, below_m);
    }
    return hidden_m;
}

static int make_from(void *user, unsigned worker, unsigned square)
{
    const struct making *making = user;
    const struct pvs *pvs = making->pvs;
    int along = pvs->along, x = (int)square % along, y = (int)square / along;
    uint8_t *first_layer = &pvs->first_layer[square * (unsigned)(along * along)];
    (void)worker;
    for (int i = 0; i < along * along; i++) {
        int to_x = i % along, to_y = i / along;
        bool swapped = abs(to_x - x) > abs(to_y - y);
        int from[2] = {swapped ? y : x, swapped ? x : y};
        int of[2] = {swapped ? to_y : to_x, swapped ? to_x : to_y};
        double hidden_m =
            hidden_below_m(making, swapped, from, of, (double)making->boxes[i].most_m[2]);
        double layers = floor((hidden_m - (double)pvs->lowest_m) / (double)pvs->layer_m);
        first_layer[i] = (uint8_t)fmin(fmax(layers, 0.0), PVS_LAYERS);
    }
    return 0;
}

int pvs_create(const struct field *field, const struct field_boxes *boxes, struct pvs *ret_pvs)
{
    struct pvs pvs = {0};
    while (pvs.level < boxes->count - 1 && boxes->levels[pvs.level].along > PVS_ALONG)
        pvs.level++;
    pvs.along = boxes->levels[pvs.level].along;
    size_t squares = (size_t)pvs.along * (size_t)pvs.along;
    *ret_pvs = (struct pvs){0};
    if (pvs.along > PVS_ALONG || field->cells * clipmap_step_rad(&field->shape, 0) > WIDE_RAD)
        return 0;
    const struct making making = {boxes->levels[pvs.level].boxes, &pvs};
    float highest_m = -INFINITY;
    pvs.lowest_m = INFINITY;
    for (size_t i = 0; i < squares; i++) {
        pvs.lowest_m = fminf(pvs.lowest_m, making.boxes[i].least_m[2]);
        highest_m = fmaxf(highest_m, making.boxes[i].most_m[2]);
    }
    pvs.layer_m = 3.0f * (highest_m - pvs.lowest_m) / PVS_LAYERS;
    pvs.first_layer = malloc(squares * squares);
    if (!pvs.first_layer ||
        parallel_run(parallel_processors(), (unsigned)squares, make_from, (void *)&making) < 0) {
        free(pvs.first_layer);
        return -ENOMEM;
    }
    *ret_pvs = pvs;
    return 0;
}

void pvs_destroy(struct pvs *pvs)
{
    free(pvs->first_layer);
    *pvs = (struct pvs){0};
}

const uint8_t *pvs_from(const struct pvs *pvs, const struct field *field, const double at[2])
{
    if (!pvs->first_layer || fmin(at[0], at[1]) < 0.0 || fmax(at[0], at[1]) >= field->cells)
        return NULL;
    int cells = field->cells / pvs->along, along = pvs->along;
    size_t square = (size_t)((int)at[1] / cells * along + (int)at[0] / cells);
    return &pvs->first_layer[square * (size_t)along * (size_t)along];
}

int pvs_layer(const struct pvs *pvs, float height_m)
{
    float layer = floorf((height_m - pvs->lowest_m) / pvs->layer_m);
    return (int)fminf(fmaxf(layer, 0.0f), PVS_LAYERS);
}
