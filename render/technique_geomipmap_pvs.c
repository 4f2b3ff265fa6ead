#include "render/technique_geomipmap_pvs.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>

#include "terrain/parallel.h"

#define SLACK    0.25  /* squares: that straight lines are off in terms of rows and columns */
#define WIDE_RAD 0.026 /* of a field, at most, for that */

/* Where on their way lines between two squares pass a plane between these: from and to which share.
 */
struct plane {
    double least, most;
};

struct making {
    const struct field_box *boxes;
    struct pvs *pvs;
    struct plane planes[PVS_ALONG][PVS_ALONG]; /* [how far the squares are apart][the plane] */
};

/* The lowest ground of squares along the minor axis, at `major` on the other. */
static float lowest_across(const struct making *making, bool swapped, int major, double from,
                           double to)
{
    int along = making->pvs->along, first = from > 0.0 ? (int)from : 0;
    int last = to < along - 1.0 ? (int)to : along - 1;
    float lowest_m = INFINITY;
    for (int minor = first; minor <= last; minor++) {
        int square = swapped ? minor * along + major : major * along + minor;
        float ground_m = making->boxes[square].least_m[2];
        lowest_m = ground_m < lowest_m ? ground_m : lowest_m;
    }
    return lowest_m;
}

/* Below which height no point of one square sees the highest of another, at the middle of each
 * square between. Places are (minor, major). */
static double hidden_below_m(const struct making *making, bool swapped, const int from[2],
                             const int of[2], double top_m)
{
    int way = of[1] > from[1] ? 1 : -1, far = abs(of[1] - from[1]);
    double hidden_m = -INFINITY, rise = of[0] - from[0];
    for (int i = 1; i < far; i++) {
        const struct plane *plane = &making->planes[far][i];
        double a = plane->least * rise, b = plane->most * rise;
        double low = from[0] - SLACK + (a < b ? a : b),
               high = from[0] + 1.0 + SLACK + (a < b ? b : a);
        double ground_m = (double)lowest_across(making, swapped, from[1] + way * i, low, high);
        if (plane->most >= 1.0 || ground_m <= hidden_m)
            continue;
        double early_m = (ground_m - top_m * plane->least) / (1.0 - plane->least);
        double late_m = (ground_m - top_m * plane->most) / (1.0 - plane->most);
        double below_m = early_m < late_m ? early_m : late_m;
        hidden_m = below_m > hidden_m ? below_m : hidden_m;
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
    struct making making = {boxes->levels[pvs.level].boxes, &pvs, {{{0}}}};
    for (int far = 1; far < PVS_ALONG; far++)
        for (int i = 1; i < far; i++)
            making.planes[far][i] = (struct plane){(i - 0.5 - SLACK) / (far + SLACK),
                                                   (i + 0.5 + SLACK) / (far - SLACK)};
    float highest_m = -INFINITY;
    pvs.lowest_m = INFINITY;
    for (size_t i = 0; i < squares; i++) {
        pvs.lowest_m = fminf(pvs.lowest_m, making.boxes[i].least_m[2]);
        highest_m = fmaxf(highest_m, making.boxes[i].most_m[2]);
    }
    pvs.layer_m = 3.0f * (highest_m - pvs.lowest_m) / PVS_LAYERS;
    pvs.first_layer = malloc(squares * squares);
    if (!pvs.first_layer ||
        parallel_run(parallel_processors(), (unsigned)squares, make_from, &making) < 0) {
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
