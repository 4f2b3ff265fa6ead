/* Views of a CIGI host. Part of io/cigi_scene. */
#include "io/cigi_scene_internal.h"

enum { USE_NEAR = 1, USE_FAR = 2, USE_LEFT = 4, USE_RIGHT = 8, USE_TOP = 16, USE_BOTTOM = 32 };
#define USE_EDGES (USE_LEFT | USE_RIGHT | USE_TOP | USE_BOTTOM)

static void turn_view(struct cigi_view *view, const struct cigi_view_control *control)
{
    float angles[3] = {control->roll_deg, control->pitch_deg, control->yaw_deg};
    view->entity = control->entity;
    cigi_take_offset(control->use, control->offset_m, angles, view->offset_m, &view->attitude);
}

static int take_view_control(struct cigi_scene *scene, const struct cigi_view_control *control,
                             struct rejection *ret_rejection)
{
    bool found = false;
    for (size_t i = 0; i < scene->views.count; i++) {
        struct cigi_view *view = cigi_table_at(&scene->views, i);
        if (control->group ? view->definition.group == control->group : view->id == control->view) {
            turn_view(view, control);
            found = true;
        }
    }
    return found ? 0
           : control->group
               ? reject(ret_rejection, REJECT_REFERENCE, 0, "there is no group %u", control->group)
               : reject(ret_rejection, REJECT_REFERENCE, 0, "there is no view %u", control->view);
}

static bool view_can_be_drawn(const struct cigi_view_definition *d)
{
    bool wide = d->left < d->right && d->bottom < d->top && d->near_m < d->far_m;
    if (d->orthographic)
        return wide;
    return wide && d->near_m > 0.0f && d->left > -90.0f && d->right < 90.0f && d->bottom > -90.0f &&
           d->top < 90.0f;
}

static int take_view_definition(struct cigi_scene *scene, const struct cigi_view_definition *given,
                                struct rejection *ret_rejection)
{
    const struct cigi_view *was = cigi_scene_view(scene, given->view);
    const struct cigi_view_definition *before =
        was ? &was->definition : &scene->own_view.definition;
    struct cigi_view_definition next = *given;
    bool other = !given->orthographic != !before->orthographic;
    if (other && (given->use & USE_EDGES) != USE_EDGES)
        return reject(ret_rejection, REJECT_RANGE, 0,
                      "view %u: another projection wants all four edges, in %s", given->view,
                      given->orthographic ? "metres" : "degrees");
    next.near_m = given->use & USE_NEAR ? given->near_m : before->near_m;
    next.far_m = given->use & USE_FAR ? given->far_m : before->far_m;
    next.left = given->use & USE_LEFT ? given->left : before->left;
    next.right = given->use & USE_RIGHT ? given->right : before->right;
    next.top = given->use & USE_TOP ? given->top : before->top;
    next.bottom = given->use & USE_BOTTOM ? given->bottom : before->bottom;
    if (!view_can_be_drawn(&next))
        return reject(ret_rejection, REJECT_RANGE, 0,
                      "view %u from %g to %g, %g to %g, %g m to %g m cannot be drawn", given->view,
                      (double)next.left, (double)next.right, (double)next.bottom, (double)next.top,
                      (double)next.near_m, (double)next.far_m);
    struct cigi_view *view = cigi_table_put(&scene->views, given->view);
    if (!view)
        return cigi_table_full("views", &scene->views, ret_rejection);
    view->definition = next;
    return 0;
}

int cigi_views_take(struct cigi_scene *scene, const struct cigi_packet *packet,
                    struct rejection *ret_rejection)
{
    switch (packet->kind) {
    case CIGI_VIEW_CONTROL:
        return take_view_control(scene, &packet->view_control, ret_rejection);
    case CIGI_VIEW_DEFINITION:
        return take_view_definition(scene, &packet->view_definition, ret_rejection);
    default:
        return 1;
    }
}
