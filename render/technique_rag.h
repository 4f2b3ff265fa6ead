/* The techniques `rag` and `rag-oblique`: Schmiade 2008, a coarse mesh that a geometry shader
 * refines in passes, each of which reads what the one before wrote (docs/techniques/rag.md). */
#pragma once

#include "render/technique.h"

struct rag_settings {
    bool oblique;  /* the paper's shader variant 2; else 1, right angles alone */
    int vertices;  /* of the coarse mesh, a side: 2 to the field's posts */
    int passes;    /* at most; no more than RAG_PASSES_MOST, nor than give a cell's edge */
    int samples;   /* of an edge that are held against the ground: 1 (the paper's), 3 to 15; only of
                      variant 2 */
    int triangles; /* for which there is room, at least; 0: RAG_TRIANGLES */
};

#define RAG_PASSES_MOST 14
#define RAG_TRIANGLES   (1 << 20)

/* As ops->create(). -EINVAL where the settings are beyond what they can be. The knob is, with
 * variant 2, how far an edge may be from the ground; with 1 the most that the heights of its ends
 * may differ: pixels. */
int rag_create(const struct technique_params *params, const struct rag_settings *settings,
               struct technique **ret_technique, struct diag *diag);

/* Of the last frame, which has to be finished: reads them from the GPU. */
struct rag_counts {
    unsigned passes, triangles; /* that are shown */
    bool has_overflowed;        /* a further pass did not fit: that one was left out */
};
struct rag_counts rag_counts(const struct technique *technique);

extern const struct technique_ops technique_rag, technique_rag_oblique;
