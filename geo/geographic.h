/* GeographicLib behind C: the only way in, so that no C++ and no exception gets past geo/.
 *
 * The ellipsoid is WGS84 throughout. The conversions are those of GeographicLib::Geocentric
 * (Karney, "Geodesics on an ellipsoid of revolution", 2011, appendix B, after Vermeille 2002): a
 * few nanometres from the Earth's centre to beyond geostationary orbit. They cannot fail; NaN in
 * gives NaN out. Any thread. */
#pragma once

#ifdef __cplusplus
extern "C" {
#endif

#include "base/diag.h"
#include "geo/pose.h"

void geocentric_from_geodetic(const struct geodetic *g, double ret_ecef_m[3]);

/* Longitude in -180..180. On the axis, where longitude is anything, it is 0. */
void geodetic_from_geocentric(const double ecef_m[3], struct geodetic *ret);

/* Cartesian east, north, up with their zero at `origin`; up is the ellipsoid's normal there. */
void enu_from_geodetic(const struct geodetic *origin, const struct geodetic *point,
                       double ret_enu_m[3]);
void geodetic_from_enu(const struct geodetic *origin, const double enu_m[3], struct geodetic *ret);

struct geoid;

/* Opens a geoid grid in the PGM form of GeographicLib (GeographicLib manual, "Geoid height") and
 * reads all of it into memory. The file's name must end in ".pgm".
 * Returns 0; -ENOENT, -EACCES where there is no such file or it may not be read; -EINVAL where the
 * name has another ending; -EBADMSG where the file is no geoid or cut short; -ENOMEM. `diag` names
 * the file. */
int geoid_open(const char *pgm_path, struct geoid **ret, struct diag *diag);

/* Height of the geoid above the ellipsoid, by cubic interpolation. Any longitude, any thread, 110
 * ns. NaN for NaN and for latitudes beyond the poles. */
double geoid_undulation_m(struct geoid *geoid, double lat_deg, double lon_deg);

/* Legal on NULL. */
void geoid_close(struct geoid *geoid);

#ifdef __cplusplus
}
#endif
