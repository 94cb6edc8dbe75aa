// Runs shaders over a scene's folder on the first Vulkan device, which its surroundings make lavapipe.
//
//   lavapipe FOLDER WIDTH HEIGHT SHADER...
//
// Shaders are SPIR-V files whose names end in their stage: one `.rgen.spv`, `.rmiss.spv` in the order of their
// records, at most one each of `.rchit.spv`, `.rahit.spv`, `.rint.spv`; or one `.comp.spv`. Bindings are those of
// `shaders/bench/bench.glsl`. Prints `rate` (millions of pixels a second of processor time, median of several
// launches), `hits` (pixels whose last number is above 0), and in milliseconds of processor time `first_launch`
// (device, pipeline and first launch) and `build` (of the bottom level, the first one apart).

#include <vulkan/vulkan.h>

#include <cstring>

#include "files.h"

static void check(VkResult result, const char* what) {
    if (result != VK_SUCCESS) {
        std::fprintf(stderr, "%s: VkResult %d\n", what, result);
        std::exit(1);
    }
}
#define CHECK(call) check(call, #call)

static VkDevice device;
static VkQueue queue;
static VkCommandPool command_pool;
static VkPhysicalDeviceMemoryProperties memory_kinds;

template <class F>
static F function(const char* name) {
    return reinterpret_cast<F>(vkGetDeviceProcAddr(device, name));
}
#define FUNCTION(name) static const auto name##_ = function<PFN_##name>(#name)

struct Buffer {
    VkBuffer buffer;
    char* bytes;
    VkDeviceAddress address;
};

static Buffer allocate(VkDeviceSize size, const void* contents = nullptr) {
    Buffer made{};
    VkBufferCreateInfo info{VK_STRUCTURE_TYPE_BUFFER_CREATE_INFO};
    info.size = size;
    info.usage = VK_BUFFER_USAGE_STORAGE_BUFFER_BIT | VK_BUFFER_USAGE_UNIFORM_BUFFER_BIT |
                 VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT | VK_BUFFER_USAGE_ACCELERATION_STRUCTURE_STORAGE_BIT_KHR |
                 VK_BUFFER_USAGE_ACCELERATION_STRUCTURE_BUILD_INPUT_READ_ONLY_BIT_KHR |
                 VK_BUFFER_USAGE_SHADER_BINDING_TABLE_BIT_KHR;
    CHECK(vkCreateBuffer(device, &info, nullptr, &made.buffer));
    VkMemoryRequirements needs;
    vkGetBufferMemoryRequirements(device, made.buffer, &needs);
    const VkMemoryPropertyFlags wanted = VK_MEMORY_PROPERTY_HOST_VISIBLE_BIT | VK_MEMORY_PROPERTY_HOST_COHERENT_BIT;
    VkMemoryAllocateFlagsInfo flags{VK_STRUCTURE_TYPE_MEMORY_ALLOCATE_FLAGS_INFO};
    flags.flags = VK_MEMORY_ALLOCATE_DEVICE_ADDRESS_BIT;
    VkMemoryAllocateInfo allocation{VK_STRUCTURE_TYPE_MEMORY_ALLOCATE_INFO, &flags, needs.size, 0};
    while (!(needs.memoryTypeBits >> allocation.memoryTypeIndex & 1) ||
           (memory_kinds.memoryTypes[allocation.memoryTypeIndex].propertyFlags & wanted) != wanted) {
        if (++allocation.memoryTypeIndex == memory_kinds.memoryTypeCount) {
            std::fprintf(stderr, "no memory that the host sees\n");
            std::exit(1);
        }
    }
    VkDeviceMemory memory;
    CHECK(vkAllocateMemory(device, &allocation, nullptr, &memory));
    CHECK(vkBindBufferMemory(device, made.buffer, memory, 0));
    void* bytes;
    CHECK(vkMapMemory(device, memory, 0, VK_WHOLE_SIZE, 0, &bytes));
    made.bytes = static_cast<char*>(bytes);
    if (contents) std::memcpy(bytes, contents, size);
    VkBufferDeviceAddressInfo address{VK_STRUCTURE_TYPE_BUFFER_DEVICE_ADDRESS_INFO, nullptr, made.buffer};
    made.address = vkGetBufferDeviceAddress(device, &address);
    return made;
}

template <class T>
static Buffer allocate(const std::vector<T>& numbers) {
    return allocate(numbers.size() * sizeof(T), numbers.data());
}

// A file's numbers; something small where there is no such file, as a binding must have a buffer.
static Buffer allocate_file(const std::string& path) {
    return allocate(exists(path) ? read<float>(path) : std::vector<float>(4));
}

// Records commands, runs them and waits; the processor time that they took.
template <class Record>
static double run(Record record) {
    VkCommandBufferAllocateInfo allocation{VK_STRUCTURE_TYPE_COMMAND_BUFFER_ALLOCATE_INFO};
    allocation.commandPool = command_pool;
    allocation.commandBufferCount = 1;
    VkCommandBuffer commands;
    CHECK(vkAllocateCommandBuffers(device, &allocation, &commands));
    VkCommandBufferBeginInfo begin{VK_STRUCTURE_TYPE_COMMAND_BUFFER_BEGIN_INFO};
    CHECK(vkBeginCommandBuffer(commands, &begin));
    record(commands);
    CHECK(vkEndCommandBuffer(commands));
    VkSubmitInfo submit{VK_STRUCTURE_TYPE_SUBMIT_INFO};
    submit.commandBufferCount = 1;
    submit.pCommandBuffers = &commands;
    const double start = processor_time();
    CHECK(vkQueueSubmit(queue, 1, &submit, VK_NULL_HANDLE));
    CHECK(vkQueueWaitIdle(queue));
    const double took = processor_time() - start;
    vkFreeCommandBuffers(device, command_pool, 1, &commands);
    return took;
}

struct Structure {
    VkAccelerationStructureKHR handle;
    VkDeviceAddress address;
    double build;
};

static Structure build(VkAccelerationStructureTypeKHR type, const VkAccelerationStructureGeometryKHR& geometry,
                       uint32_t count, int times) {
    FUNCTION(vkGetAccelerationStructureBuildSizesKHR);
    FUNCTION(vkCreateAccelerationStructureKHR);
    FUNCTION(vkCmdBuildAccelerationStructuresKHR);
    FUNCTION(vkGetAccelerationStructureDeviceAddressKHR);
    Structure made{};
    VkAccelerationStructureBuildGeometryInfoKHR info{VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_BUILD_GEOMETRY_INFO_KHR};
    info.type = type;
    info.flags = VK_BUILD_ACCELERATION_STRUCTURE_PREFER_FAST_TRACE_BIT_KHR;
    info.geometryCount = 1;
    info.pGeometries = &geometry;
    VkAccelerationStructureBuildSizesInfoKHR sizes{VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_BUILD_SIZES_INFO_KHR};
    vkGetAccelerationStructureBuildSizesKHR_(device, VK_ACCELERATION_STRUCTURE_BUILD_TYPE_DEVICE_KHR, &info, &count, &sizes);
    VkAccelerationStructureCreateInfoKHR create{VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_CREATE_INFO_KHR};
    create.buffer = allocate(sizes.accelerationStructureSize).buffer;
    create.size = sizes.accelerationStructureSize;
    create.type = type;
    CHECK(vkCreateAccelerationStructureKHR_(device, &create, nullptr, &made.handle));
    info.dstAccelerationStructure = made.handle;
    // Scratch memory lies at multiples of 256 at most.
    info.scratchData.deviceAddress = (allocate(sizes.buildScratchSize + 256).address + 255) / 256 * 256;
    const VkAccelerationStructureBuildRangeInfoKHR range{count, 0, 0, 0};
    const VkAccelerationStructureBuildRangeInfoKHR* ranges = &range;
    std::vector<double> took;
    for (int time = 0; time < times; time++) {
        took.push_back(run(
            [&](VkCommandBuffer commands) { vkCmdBuildAccelerationStructuresKHR_(commands, 1, &info, &ranges); }));
    }
    // The first one compiles the driver's own shaders.
    if (times > 1) took.erase(took.begin());
    made.build = median(took);
    VkAccelerationStructureDeviceAddressInfoKHR address{VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_DEVICE_ADDRESS_INFO_KHR};
    address.accelerationStructure = made.handle;
    made.address = vkGetAccelerationStructureDeviceAddressKHR_(device, &address);
    return made;
}

static bool ends_with(const std::string& name, const std::string& end) {
    return name.size() >= end.size() && name.compare(name.size() - end.size(), end.size(), end) == 0;
}

// The device, with what ray tracing needs; the properties of its shader binding tables.
static VkPhysicalDeviceRayTracingPipelinePropertiesKHR open_device() {
    VkApplicationInfo application{VK_STRUCTURE_TYPE_APPLICATION_INFO};
    application.apiVersion = VK_API_VERSION_1_3;
    VkInstanceCreateInfo instance_info{VK_STRUCTURE_TYPE_INSTANCE_CREATE_INFO};
    instance_info.pApplicationInfo = &application;
    VkInstance instance;
    CHECK(vkCreateInstance(&instance_info, nullptr, &instance));
    uint32_t count = 1;
    VkPhysicalDevice physical;
    const VkResult found = vkEnumeratePhysicalDevices(instance, &count, &physical);
    if (found != VK_INCOMPLETE) check(found, "vkEnumeratePhysicalDevices");
    if (count == 0) {
        std::fprintf(stderr, "no Vulkan device\n");
        std::exit(1);
    }
    vkGetPhysicalDeviceMemoryProperties(physical, &memory_kinds);
    VkPhysicalDeviceRayTracingPipelinePropertiesKHR tables{VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_RAY_TRACING_PIPELINE_PROPERTIES_KHR};
    VkPhysicalDeviceDriverProperties driver{VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_DRIVER_PROPERTIES, &tables};
    VkPhysicalDeviceProperties2 properties{VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_PROPERTIES_2, &driver};
    vkGetPhysicalDeviceProperties2(physical, &properties);
    std::fprintf(stderr, "%s, %s\n", properties.properties.deviceName, driver.driverInfo);
    VkPhysicalDeviceRayQueryFeaturesKHR queries{VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_RAY_QUERY_FEATURES_KHR};
    queries.rayQuery = VK_TRUE;
    VkPhysicalDeviceRayTracingPipelineFeaturesKHR pipelines{
        VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_RAY_TRACING_PIPELINE_FEATURES_KHR, &queries};
    pipelines.rayTracingPipeline = VK_TRUE;
    VkPhysicalDeviceAccelerationStructureFeaturesKHR structures{
        VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_ACCELERATION_STRUCTURE_FEATURES_KHR, &pipelines};
    structures.accelerationStructure = VK_TRUE;
    VkPhysicalDeviceBufferDeviceAddressFeatures addresses{
        VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_BUFFER_DEVICE_ADDRESS_FEATURES, &structures};
    addresses.bufferDeviceAddress = VK_TRUE;
    // lavapipe has one family, which does everything.
    const float priority = 1;
    VkDeviceQueueCreateInfo queue_info{VK_STRUCTURE_TYPE_DEVICE_QUEUE_CREATE_INFO};
    queue_info.queueCount = 1;
    queue_info.pQueuePriorities = &priority;
    const char* extensions[] = {"VK_KHR_acceleration_structure", "VK_KHR_ray_tracing_pipeline", "VK_KHR_ray_query",
                                "VK_KHR_deferred_host_operations"};
    VkDeviceCreateInfo device_info{VK_STRUCTURE_TYPE_DEVICE_CREATE_INFO, &addresses};
    device_info.queueCreateInfoCount = 1;
    device_info.pQueueCreateInfos = &queue_info;
    device_info.enabledExtensionCount = std::size(extensions);
    device_info.ppEnabledExtensionNames = extensions;
    CHECK(vkCreateDevice(physical, &device_info, nullptr, &device));
    vkGetDeviceQueue(device, 0, 0, &queue);
    VkCommandPoolCreateInfo pool_info{VK_STRUCTURE_TYPE_COMMAND_POOL_CREATE_INFO};
    CHECK(vkCreateCommandPool(device, &pool_info, nullptr, &command_pool));
    return tables;
}

int main(int count, char** arguments) {
    if (count < 5) {
        std::fprintf(stderr, "usage: lavapipe FOLDER WIDTH HEIGHT SHADER...\n");
        return 2;
    }
    const std::string folder = arguments[1];
    const uint32_t width = uint32_t(std::atoi(arguments[2])), height = uint32_t(std::atoi(arguments[3]));
    const std::vector<std::string> shaders(arguments + 4, arguments + count);
    double getting_ready = -processor_time();
    const auto tables = open_device();
    getting_ready += processor_time();

    // The scene.
    VkAccelerationStructureGeometryKHR geometry{VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_GEOMETRY_KHR};
    geometry.flags = VK_GEOMETRY_OPAQUE_BIT_KHR;
    for (const std::string& shader : shaders) {
        if (ends_with(shader, ".rahit.spv")) geometry.flags = 0;
    }
    const bool triangles = exists(folder + "/vertices");
    uint32_t primitives;
    if (triangles) {
        const auto vertices = read<float>(folder + "/vertices");
        const auto indices = read<uint32_t>(folder + "/indices");
        primitives = uint32_t(indices.size() / 3);
        geometry.geometryType = VK_GEOMETRY_TYPE_TRIANGLES_KHR;
        auto& data = geometry.geometry.triangles = {VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_GEOMETRY_TRIANGLES_DATA_KHR};
        data.vertexFormat = VK_FORMAT_R32G32B32_SFLOAT;
        data.vertexData.deviceAddress = allocate(vertices).address;
        data.vertexStride = 12;
        data.maxVertex = uint32_t(vertices.size() / 3 - 1);
        data.indexType = VK_INDEX_TYPE_UINT32;
        data.indexData.deviceAddress = allocate(indices).address;
    } else {
        const auto boxes = read<float>(folder + "/boxes");
        primitives = uint32_t(boxes.size() / 6);
        geometry.geometryType = VK_GEOMETRY_TYPE_AABBS_KHR;
        auto& data = geometry.geometry.aabbs = {VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_GEOMETRY_AABBS_DATA_KHR};
        data.data.deviceAddress = allocate(boxes).address;
        data.stride = sizeof(VkAabbPositionsKHR);
    }
    const Structure bottom = build(VK_ACCELERATION_STRUCTURE_TYPE_BOTTOM_LEVEL_KHR, geometry, primitives, 4);
    const auto transforms = read<VkTransformMatrixKHR>(folder + "/transforms");
    std::vector<VkAccelerationStructureInstanceKHR> instances;
    for (const VkTransformMatrixKHR& transform : transforms) {
        VkAccelerationStructureInstanceKHR instance{};
        instance.transform = transform;
        instance.mask = 0xFF;
        instance.flags = VK_GEOMETRY_INSTANCE_TRIANGLE_FACING_CULL_DISABLE_BIT_KHR;
        instance.accelerationStructureReference = bottom.address;
        instances.push_back(instance);
    }
    VkAccelerationStructureGeometryKHR placed{VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_GEOMETRY_KHR};
    placed.geometryType = VK_GEOMETRY_TYPE_INSTANCES_KHR;
    placed.geometry.instances = {VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_GEOMETRY_INSTANCES_DATA_KHR};
    placed.geometry.instances.data.deviceAddress = allocate(instances).address;
    const Structure top =
        build(VK_ACCELERATION_STRUCTURE_TYPE_TOP_LEVEL_KHR, placed, uint32_t(instances.size()), 1);

    // What the shaders read and write.
    const size_t pixels = size_t(width) * height;
    const Buffer outputs = allocate(pixels * 16);
    const Buffer buffers[] = {
        outputs,
        allocate_file(folder + "/inputs"),
        allocate_file(folder + "/indices"),
        allocate_file(folder + "/normals"),
        allocate_file(folder + (exists(folder + "/ends") ? "/ends" : "/spheres")),
    };
    const uint32_t bindings = 1 + std::size(buffers);
    std::vector<VkDescriptorSetLayoutBinding> layout_bindings;
    for (uint32_t binding = 0; binding < bindings; binding++) {
        const VkDescriptorType type = binding == 0   ? VK_DESCRIPTOR_TYPE_ACCELERATION_STRUCTURE_KHR
                                      : binding == 2 ? VK_DESCRIPTOR_TYPE_UNIFORM_BUFFER
                                                     : VK_DESCRIPTOR_TYPE_STORAGE_BUFFER;
        layout_bindings.push_back({binding, type, 1, VK_SHADER_STAGE_ALL, nullptr});
    }
    VkDescriptorSetLayoutCreateInfo set_info{VK_STRUCTURE_TYPE_DESCRIPTOR_SET_LAYOUT_CREATE_INFO};
    set_info.bindingCount = bindings;
    set_info.pBindings = layout_bindings.data();
    VkDescriptorSetLayout set_layout;
    CHECK(vkCreateDescriptorSetLayout(device, &set_info, nullptr, &set_layout));
    VkPipelineLayoutCreateInfo layout_info{VK_STRUCTURE_TYPE_PIPELINE_LAYOUT_CREATE_INFO};
    layout_info.setLayoutCount = 1;
    layout_info.pSetLayouts = &set_layout;
    VkPipelineLayout layout;
    CHECK(vkCreatePipelineLayout(device, &layout_info, nullptr, &layout));
    const VkDescriptorPoolSize pool_sizes[] = {{VK_DESCRIPTOR_TYPE_ACCELERATION_STRUCTURE_KHR, 1},
                                               {VK_DESCRIPTOR_TYPE_UNIFORM_BUFFER, 1},
                                               {VK_DESCRIPTOR_TYPE_STORAGE_BUFFER, bindings}};
    VkDescriptorPoolCreateInfo pool_info{VK_STRUCTURE_TYPE_DESCRIPTOR_POOL_CREATE_INFO};
    pool_info.maxSets = 1;
    pool_info.poolSizeCount = std::size(pool_sizes);
    pool_info.pPoolSizes = pool_sizes;
    VkDescriptorPool pool;
    CHECK(vkCreateDescriptorPool(device, &pool_info, nullptr, &pool));
    VkDescriptorSetAllocateInfo set_allocation{VK_STRUCTURE_TYPE_DESCRIPTOR_SET_ALLOCATE_INFO};
    set_allocation.descriptorPool = pool;
    set_allocation.descriptorSetCount = 1;
    set_allocation.pSetLayouts = &set_layout;
    VkDescriptorSet set;
    CHECK(vkAllocateDescriptorSets(device, &set_allocation, &set));
    VkWriteDescriptorSetAccelerationStructureKHR structure{VK_STRUCTURE_TYPE_WRITE_DESCRIPTOR_SET_ACCELERATION_STRUCTURE_KHR};
    structure.accelerationStructureCount = 1;
    structure.pAccelerationStructures = &top.handle;
    std::vector<VkDescriptorBufferInfo> infos;
    for (const Buffer& buffer : buffers) infos.push_back({buffer.buffer, 0, VK_WHOLE_SIZE});
    std::vector<VkWriteDescriptorSet> writes;
    for (uint32_t binding = 0; binding < bindings; binding++) {
        VkWriteDescriptorSet write{VK_STRUCTURE_TYPE_WRITE_DESCRIPTOR_SET};
        write.dstSet = set;
        write.dstBinding = binding;
        write.descriptorCount = 1;
        write.descriptorType = layout_bindings[binding].descriptorType;
        if (binding == 0) {
            write.pNext = &structure;
        } else {
            write.pBufferInfo = &infos[binding - 1];
        }
        writes.push_back(write);
    }
    vkUpdateDescriptorSets(device, bindings, writes.data(), 0, nullptr);

    // The pipeline.
    getting_ready -= processor_time();
    std::vector<VkPipelineShaderStageCreateInfo> stages;
    std::vector<VkRayTracingShaderGroupCreateInfoKHR> groups;
    const auto group = [](VkRayTracingShaderGroupTypeKHR type) {
        VkRayTracingShaderGroupCreateInfoKHR group{VK_STRUCTURE_TYPE_RAY_TRACING_SHADER_GROUP_CREATE_INFO_KHR};
        group.type = type;
        group.generalShader = group.closestHitShader = group.anyHitShader = group.intersectionShader = VK_SHADER_UNUSED_KHR;
        return group;
    };
    auto hit = group(triangles ? VK_RAY_TRACING_SHADER_GROUP_TYPE_TRIANGLES_HIT_GROUP_KHR
                               : VK_RAY_TRACING_SHADER_GROUP_TYPE_PROCEDURAL_HIT_GROUP_KHR);
    bool compute = false;
    for (const std::string& shader : shaders) {
        const auto code = read<uint32_t>(shader);
        VkShaderModuleCreateInfo module_info{VK_STRUCTURE_TYPE_SHADER_MODULE_CREATE_INFO};
        module_info.codeSize = code.size() * 4;
        module_info.pCode = code.data();
        VkPipelineShaderStageCreateInfo stage{VK_STRUCTURE_TYPE_PIPELINE_SHADER_STAGE_CREATE_INFO};
        CHECK(vkCreateShaderModule(device, &module_info, nullptr, &stage.module));
        stage.pName = "main";
        const uint32_t number = uint32_t(stages.size());
        auto general = group(VK_RAY_TRACING_SHADER_GROUP_TYPE_GENERAL_KHR);
        general.generalShader = number;
        if (ends_with(shader, ".comp.spv")) {
            stage.stage = VK_SHADER_STAGE_COMPUTE_BIT;
            compute = true;
        } else if (ends_with(shader, ".rgen.spv")) {
            stage.stage = VK_SHADER_STAGE_RAYGEN_BIT_KHR;
            groups.insert(groups.begin(), general);
        } else if (ends_with(shader, ".rmiss.spv")) {
            stage.stage = VK_SHADER_STAGE_MISS_BIT_KHR;
            groups.push_back(general);
        } else if (ends_with(shader, ".rchit.spv")) {
            stage.stage = VK_SHADER_STAGE_CLOSEST_HIT_BIT_KHR;
            hit.closestHitShader = number;
        } else if (ends_with(shader, ".rahit.spv")) {
            stage.stage = VK_SHADER_STAGE_ANY_HIT_BIT_KHR;
            hit.anyHitShader = number;
        } else if (ends_with(shader, ".rint.spv")) {
            stage.stage = VK_SHADER_STAGE_INTERSECTION_BIT_KHR;
            hit.intersectionShader = number;
        } else {
            std::fprintf(stderr, "%s: its name does not tell its stage\n", shader.c_str());
            return 2;
        }
        stages.push_back(stage);
    }
    const uint32_t misses = compute ? 0 : uint32_t(groups.size() - 1);
    groups.push_back(hit);
    VkPipeline pipeline;
    VkStridedDeviceAddressRegionKHR generation{}, miss{}, hits{}, callable{};
    if (compute) {
        VkComputePipelineCreateInfo info{VK_STRUCTURE_TYPE_COMPUTE_PIPELINE_CREATE_INFO};
        info.layout = layout;
        info.stage = stages[0];
        CHECK(vkCreateComputePipelines(device, VK_NULL_HANDLE, 1, &info, nullptr, &pipeline));
    } else {
        FUNCTION(vkCreateRayTracingPipelinesKHR);
        FUNCTION(vkGetRayTracingShaderGroupHandlesKHR);
        VkRayTracingPipelineCreateInfoKHR info{VK_STRUCTURE_TYPE_RAY_TRACING_PIPELINE_CREATE_INFO_KHR};
        info.stageCount = uint32_t(stages.size());
        info.pStages = stages.data();
        info.groupCount = uint32_t(groups.size());
        info.pGroups = groups.data();
        info.maxPipelineRayRecursionDepth = 1;
        info.layout = layout;
        CHECK(vkCreateRayTracingPipelinesKHR_(device, VK_NULL_HANDLE, VK_NULL_HANDLE, 1, &info, nullptr, &pipeline));
        // A record a group, each where a table may begin.
        const uint32_t handle = tables.shaderGroupHandleSize;
        const uint32_t stride = std::max(tables.shaderGroupBaseAlignment, handle);
        std::vector<char> handles(handle * groups.size());
        CHECK(vkGetRayTracingShaderGroupHandlesKHR_(device, pipeline, 0, uint32_t(groups.size()), handles.size(), handles.data()));
        const Buffer table = allocate(stride * (groups.size() + 1));
        const VkDeviceAddress start = (table.address + stride - 1) / stride * stride;
        for (size_t at = 0; at < groups.size(); at++) {
            std::memcpy(table.bytes + (start - table.address) + at * stride, &handles[at * handle], handle);
        }
        generation = {start, stride, stride};
        miss = {start + stride, stride, stride * misses};
        hits = {start + stride * (1 + misses), stride, stride};
    }
    const auto launch = [&](VkCommandBuffer commands) {
        FUNCTION(vkCmdTraceRaysKHR);
        const auto point = compute ? VK_PIPELINE_BIND_POINT_COMPUTE : VK_PIPELINE_BIND_POINT_RAY_TRACING_KHR;
        vkCmdBindPipeline(commands, point, pipeline);
        vkCmdBindDescriptorSets(commands, point, layout, 0, 1, &set, 0, nullptr);
        if (compute) {
            // Its workgroups are 32 x 1.
            vkCmdDispatch(commands, width / 32, height, 1);
        } else {
            vkCmdTraceRaysKHR_(commands, &generation, &miss, &hits, &callable, width, height, 1);
        }
    };
    run(launch);
    getting_ready += processor_time();
    std::vector<double> times;
    for (int time = 0; time < 4; time++) {
        const double took = run(launch);
        if (time > 0) times.push_back(took);
    }
    size_t found = 0;
    const float* numbers = reinterpret_cast<const float*>(outputs.bytes);
    for (size_t pixel = 0; pixel < pixels; pixel++) found += numbers[4 * pixel + 3] > 0;
    std::printf("rate %f\nhits %zu\n", double(pixels) / median(times) / 1e6, found);
    std::printf("first_launch %f\nbuild %f\n", 1e3 * getting_ready, 1e3 * bottom.build);
    return 0;
}
