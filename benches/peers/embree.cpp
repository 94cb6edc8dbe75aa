// Traces the rays of a scene's folder through Embree, on one thread.
//
//   embree FOLDER RAYS [THREADS]
//
// RAYS is 1 for single rays, 8 for packets of eight, 0 to build only. Prints `rate` (millions of rays a
// second of processor time), `hits`, `build` (milliseconds of it) and `wall` (of wall time, by THREADS
// threads, 1 unless given), medians of several runs each, and `bytes` (what geometry and tree take).
// Triangles, spheres as points, pairs of ends as round linear curves; ends that are one sphere as a point.

#include <embree4/rtcore.h>
#include <pmmintrin.h>
#include <xmmintrin.h>

#include <atomic>
#include <chrono>
#include <cstring>

#include "files.h"

static RTCDevice device;

// What Embree has allocated; builds tell it from several threads.
static std::atomic<long long> allocated;

static bool note_memory(void*, ssize_t bytes, bool) {
    allocated += bytes;
    return true;
}

static void* buffer(RTCGeometry geometry, RTCBufferType type, RTCFormat format, size_t stride, size_t count) {
    return rtcSetNewGeometryBuffer(geometry, type, 0, format, stride, count);
}

static void attach(RTCScene scene, RTCGeometry geometry) {
    rtcCommitGeometry(geometry);
    rtcAttachGeometry(scene, geometry);
    rtcReleaseGeometry(geometry);
}

static void points(RTCScene scene, const std::vector<float>& spheres) {
    if (spheres.empty()) return;
    RTCGeometry geometry = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_SPHERE_POINT);
    void* to = buffer(geometry, RTC_BUFFER_TYPE_VERTEX, RTC_FORMAT_FLOAT4, 16, spheres.size() / 4);
    std::memcpy(to, spheres.data(), spheres.size() * 4);
    attach(scene, geometry);
}

static void triangles(RTCScene scene, const std::vector<float>& vertices, const std::vector<uint32_t>& indices) {
    RTCGeometry geometry = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_TRIANGLE);
    void* to = buffer(geometry, RTC_BUFFER_TYPE_VERTEX, RTC_FORMAT_FLOAT3, 12, vertices.size() / 3);
    std::memcpy(to, vertices.data(), vertices.size() * 4);
    to = buffer(geometry, RTC_BUFFER_TYPE_INDEX, RTC_FORMAT_UINT3, 12, indices.size() / 3);
    std::memcpy(to, indices.data(), indices.size() * 4);
    attach(scene, geometry);
}

static void curves(RTCScene scene, const std::vector<float>& ends) {
    std::vector<float> round, whole;
    for (size_t at = 0; at < ends.size(); at += 8) {
        if (std::equal(&ends[at], &ends[at] + 4, &ends[at] + 4)) {
            whole.insert(whole.end(), &ends[at], &ends[at] + 4);
        } else {
            round.insert(round.end(), &ends[at], &ends[at] + 8);
        }
    }
    const size_t count = round.size() / 8;
    RTCGeometry geometry = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_ROUND_LINEAR_CURVE);
    std::memcpy(buffer(geometry, RTC_BUFFER_TYPE_VERTEX, RTC_FORMAT_FLOAT4, 16, 2 * count), round.data(), round.size() * 4);
    auto* indices = static_cast<uint32_t*>(buffer(geometry, RTC_BUFFER_TYPE_INDEX, RTC_FORMAT_UINT, 4, count));
    for (size_t at = 0; at < count; at++) indices[at] = uint32_t(2 * at);
    std::memset(buffer(geometry, RTC_BUFFER_TYPE_FLAGS, RTC_FORMAT_UCHAR, 1, count), 0, count);
    attach(scene, geometry);
    points(scene, whole);
}

// Processor time and wall time, in seconds.
struct Times {
    double processor, wall;
};

static Times now() {
    const auto wall = std::chrono::steady_clock::now().time_since_epoch();
    return {processor_time(), std::chrono::duration<double>(wall).count()};
}

// The tree over a folder's primitives, and the time that it took.
static RTCScene build(const std::string& folder, Times* took) {
    RTCScene scene = rtcNewScene(device);
    if (exists(folder + "/vertices")) {
        triangles(scene, read<float>(folder + "/vertices"), read<uint32_t>(folder + "/indices"));
    } else if (exists(folder + "/ends")) {
        curves(scene, read<float>(folder + "/ends"));
    } else {
        points(scene, read<float>(folder + "/spheres"));
    }
    const Times begin = now();
    rtcCommitScene(scene);
    const Times end = now();
    *took = {end.processor - begin.processor, end.wall - begin.wall};
    return scene;
}

static RTCScene instances(RTCScene placed, const std::vector<float>& transforms) {
    RTCScene scene = rtcNewScene(device);
    for (size_t at = 0; at < transforms.size(); at += 12) {
        RTCGeometry geometry = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_INSTANCE);
        rtcSetGeometryInstancedScene(geometry, placed);
        rtcSetGeometryTransform(geometry, 0, RTC_FORMAT_FLOAT3X4_ROW_MAJOR, &transforms[at]);
        attach(scene, geometry);
    }
    rtcCommitScene(scene);
    return scene;
}

static size_t single(RTCScene scene, const std::vector<float>& rays) {
    size_t hits = 0;
    for (size_t at = 0; at < rays.size(); at += 8) {
        const float* from = &rays[at];
        RTCRayHit ray{};
        ray.ray.org_x = from[0], ray.ray.org_y = from[1], ray.ray.org_z = from[2], ray.ray.tnear = from[3];
        ray.ray.dir_x = from[4], ray.ray.dir_y = from[5], ray.ray.dir_z = from[6], ray.ray.tfar = from[7];
        ray.ray.mask = ~0u;
        ray.hit.geomID = ray.hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
        rtcIntersect1(scene, &ray);
        hits += ray.hit.geomID != RTC_INVALID_GEOMETRY_ID;
    }
    return hits;
}

static size_t packets(RTCScene scene, const std::vector<float>& rays) {
    size_t hits = 0;
    alignas(32) const int valid[8] = {-1, -1, -1, -1, -1, -1, -1, -1};
    for (size_t at = 0; at < rays.size(); at += 64) {
        alignas(32) RTCRayHit8 ray{};
        for (size_t lane = 0; lane < 8; lane++) {
            const float* from = &rays[at + 8 * lane];
            ray.ray.org_x[lane] = from[0], ray.ray.org_y[lane] = from[1], ray.ray.org_z[lane] = from[2];
            ray.ray.dir_x[lane] = from[4], ray.ray.dir_y[lane] = from[5], ray.ray.dir_z[lane] = from[6];
            ray.ray.tnear[lane] = from[3], ray.ray.tfar[lane] = from[7];
            ray.ray.mask[lane] = ~0u;
            ray.hit.geomID[lane] = ray.hit.instID[0][lane] = RTC_INVALID_GEOMETRY_ID;
        }
        rtcIntersect8(valid, scene, &ray);
        for (unsigned geometry : ray.hit.geomID) hits += geometry != RTC_INVALID_GEOMETRY_ID;
    }
    return hits;
}

int main(int count, char** arguments) {
    if (count != 3 && count != 4) {
        std::fprintf(stderr, "usage: embree FOLDER 0|1|8 [THREADS]\n");
        return 2;
    }
    const std::string folder = arguments[1];
    const int together = std::atoi(arguments[2]);
    // As its manual asks for.
    _MM_SET_FLUSH_ZERO_MODE(_MM_FLUSH_ZERO_ON);
    _MM_SET_DENORMALS_ZERO_MODE(_MM_DENORMALS_ZERO_ON);
    const std::string threads = count > 3 ? arguments[3] : "1";
    device = rtcNewDevice(("threads=" + threads).c_str());
    rtcSetDeviceMemoryMonitorFunction(device, note_memory, nullptr);

    std::vector<double> builds, walls;
    RTCScene scene = nullptr;
    double spent = 0;
    // Several, unless each takes seconds.
    while (builds.empty() || (together == 0 && builds.size() < 7 && spent < 3)) {
        if (scene) rtcReleaseScene(scene);
        Times took;
        scene = build(folder, &took);
        builds.push_back(took.processor);
        walls.push_back(took.wall);
        spent += took.wall;
    }
    std::printf("build %f\nwall %f\nbytes %lld\n", 1e3 * median(builds), 1e3 * median(walls), allocated.load());
    if (together == 0) return 0;

    const auto transforms = read<float>(folder + "/transforms");
    if (transforms.size() > 12) scene = instances(scene, transforms);
    const auto rays = read<float>(folder + "/rays");
    size_t hits = 0;
    std::vector<double> times;
    for (int run = 0; run < 4; run++) {
        const double begin = processor_time();
        hits = together == 1 ? single(scene, rays) : packets(scene, rays);
        // The first one warms up.
        if (run > 0) times.push_back(processor_time() - begin);
    }
    std::printf("rate %f\nhits %zu\n", double(rays.size() / 8) / median(times) / 1e6, hits);
    return 0;
}
