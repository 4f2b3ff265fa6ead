// A row of a persistent grid on the ground plane (persistent_grid_cover.h): all rays of one row of the
// auxiliary camera's picture meet it equally far ahead.
struct GridRow {
    float along;       // m ahead
    float left, right; // of that line, m
    float unused;
};
layout(std430, binding = 0) buffer GridRows { GridRow grid_rows[]; };
