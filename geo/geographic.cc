#include "geo/geographic.h"

#include <cerrno>
#include <cmath>
#include <cstring>
#include <exception>
#include <limits>
#include <new>
#include <string>
#include <unistd.h>

#include <GeographicLib/Geocentric.hpp>
#include <GeographicLib/Geoid.hpp>
#include <GeographicLib/LocalCartesian.hpp>

using GeographicLib::Geocentric;
using GeographicLib::Geoid;
using GeographicLib::LocalCartesian;

/* Neither Geocentric nor LocalCartesian throws for any number. Were that promise ever broken, this
 * ends the program here rather than unwind through C. */
template <typename Conversion>
static void never_throwing(Conversion convert) noexcept
{
    convert();
}

void geocentric_from_geodetic(const struct geodetic *g, double ret_ecef_m[3])
{
    never_throwing([=] {
        Geocentric::WGS84().Forward(g->lat_deg, g->lon_deg, g->height_m, ret_ecef_m[0],
                                    ret_ecef_m[1], ret_ecef_m[2]);
    });
}

void geodetic_from_geocentric(const double ecef_m[3], struct geodetic *ret)
{
    never_throwing([=] {
        Geocentric::WGS84().Reverse(ecef_m[0], ecef_m[1], ecef_m[2], ret->lat_deg, ret->lon_deg,
                                    ret->height_m);
    });
}

void enu_from_geodetic(const struct geodetic *origin, const struct geodetic *point,
                       double ret_enu_m[3])
{
    never_throwing([=] {
        LocalCartesian local(origin->lat_deg, origin->lon_deg, origin->height_m);
        local.Forward(point->lat_deg, point->lon_deg, point->height_m, ret_enu_m[0], ret_enu_m[1],
                      ret_enu_m[2]);
    });
}

void geodetic_from_enu(const struct geodetic *origin, const double enu_m[3], struct geodetic *ret)
{
    never_throwing([=] {
        LocalCartesian local(origin->lat_deg, origin->lon_deg, origin->height_m);
        local.Reverse(enu_m[0], enu_m[1], enu_m[2], ret->lat_deg, ret->lon_deg, ret->height_m);
    });
}

struct geoid {
    Geoid grid;
    geoid(const std::string &stem, const std::string &directory)
        : grid(stem, directory, true, true) /* cubic, for several threads */
    {
    }
};

/* The library wants the directory and the name without its ending, apart. */
static int split_path(const std::string &path, std::string *directory, std::string *stem)
{
    const std::string ending = ".pgm";
    size_t slash = path.rfind('/');
    size_t start = slash == std::string::npos ? 0 : slash + 1;
    if (path.size() - start <= ending.size() ||
        path.compare(path.size() - ending.size(), ending.size(), ending) != 0)
        return -EINVAL;
    *directory = slash == std::string::npos ? "." : slash == 0 ? "/" : path.substr(0, slash);
    *stem = path.substr(start, path.size() - start - ending.size());
    return 0;
}

int geoid_open(const char *pgm_path, struct geoid **ret, struct diag *diag)
{
    try {
        std::string directory, stem;
        if (split_path(pgm_path, &directory, &stem) < 0)
            return diag_set(diag, -EINVAL, "geoid %s: the name of a geoid grid ends in .pgm",
                            pgm_path);
        if (access(pgm_path, R_OK) < 0)
            return diag_set(diag, -errno, "geoid %s: %s", pgm_path, strerror(errno));
        *ret = new struct geoid(stem, directory);
        return 0;
    } catch (const std::bad_alloc &) {
        return diag_set(diag, -ENOMEM, "geoid %s: out of memory", pgm_path);
    } catch (const std::exception &error) {
        return diag_set(diag, -EBADMSG, "geoid %s: %s", pgm_path, error.what());
    } catch (...) {
        return diag_set(diag, -EBADMSG, "geoid %s: cannot be read", pgm_path);
    }
}

double geoid_undulation_m(struct geoid *geoid, double lat_deg, double lon_deg)
{
    const double nan = std::numeric_limits<double>::quiet_NaN();
    if (!(std::fabs(lat_deg) <= 90.0) || !std::isfinite(lon_deg))
        return nan;
    try {
        return geoid->grid(lat_deg, lon_deg);
    } catch (...) {
        return nan;
    }
}

void geoid_close(struct geoid *geoid)
{
    delete geoid;
}
