// Between two passes: what the next one reads, and what would be shown if it were the last.
layout(local_size_x = 1) in;

layout(location = 0) uniform int pass;

void show()
{
    int from = pass & 1;
    control.shown[from] = Command(3 * control.written, 1, 0, 0);
    control.shown[1 - from] = Command(0, 1, 0, 0);
    control.passes = pass;
    control.triangles = control.written;
}

void main()
{
    if (pass == 0) {
        control.is_over = control.has_overflowed = 0;
        show();
    } else if (control.is_over == 0) {
        if (control.written < control.generated) { // of a mesh in parts the one before is whole
            control.has_overflowed = control.is_over = 1;
        } else {
            show();
            control.is_over = 1 - control.has_split;
        }
    }
    control.next = Command(control.is_over == 0 ? 3 * control.written : 0, 1, 0, 0);
    control.has_split = 0;
}
