// What a pass of technique_rag leaves to the next.
struct Command { // as for glDrawArraysIndirect
    uint count, instances, first, base;
};

layout(std430, binding = 0) buffer Control {
    uint written, generated; // triangles of the last pass: query results
    uint has_split;          // it cut an edge
    uint is_over;            // no further pass does anything
    Command next;            // what the next pass reads
    Command shown[2];        // what is drawn from each of the two buffers
    uint passes, triangles;  // that are shown
    uint has_overflowed;     // a pass did not fit
} control;
