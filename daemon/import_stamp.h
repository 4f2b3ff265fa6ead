/* `otwd-import --stamp RASTER`: for `otwd dig`, the bytes of a raster's stamp on standard output.
 */
#pragma once

int stamp_main(int argc, char **argv);
