// The comparison for tests/bench/stream: what it costs to send the whole mesh again after every parameter change.
// Serves one client on loopback: for each line it receives (an alpha), fuses all vertices, encodes mesh and colours as
// one Draco stream at speed 7 and writes its length (u32, little-endian) and bytes.
//   whole_mesh_sender SCENE.ply POSITION_STEP_M     prints the port it listens on
#include <arpa/inet.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <sys/socket.h>
#include <unistd.h>

#include <draco/compression/expert_encode.h>
#include <draco/mesh/mesh.h>
#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <memory>
#include <string>
#include <vector>

#include "fusion/files/ply_reader.hpp"
#include "fusion/fusion_plan.hpp"

namespace {

using namespace spectra;

constexpr int kSpeed = 7;

fusion::SceneTemperature temperature_of(const mesh::MultispectralMesh& mesh) {
  fusion::TemperatureAccumulator accumulator;
  accumulator.add(mesh.temperature_celsius());
  fusion::SceneTemperature temperature;
  temperature.summary = accumulator.summary();
  return temperature;
}

/// The mesh with its positions; colours are written into its second attribute before each encoding.
std::unique_ptr<draco::Mesh> draco_mesh(const mesh::MultispectralMesh& mesh) {
  auto result = std::make_unique<draco::Mesh>();
  const auto count = static_cast<std::uint32_t>(mesh.vertex_count());
  result->set_num_points(count);
  draco::GeometryAttribute position;
  position.Init(draco::GeometryAttribute::POSITION, nullptr, 3, draco::DT_FLOAT32, false, sizeof(base::Vec3f), 0);
  draco::GeometryAttribute colour;
  colour.Init(draco::GeometryAttribute::COLOR, nullptr, 3, draco::DT_UINT8, true, 3, 0);
  const int position_id = result->AddAttribute(position, true, count);
  result->AddAttribute(colour, true, count);
  for (std::uint32_t i = 0; i < count; ++i) {
    result->attribute(position_id)->SetAttributeValue(draco::AttributeValueIndex(i), &mesh.positions()[i]);
  }
  result->SetNumFaces(mesh.triangle_count());
  for (std::uint32_t i = 0; i < mesh.triangle_count(); ++i) {
    const base::Triangle& t = mesh.triangles()[i];
    result->SetFace(draco::FaceIndex(i), {draco::PointIndex(t[0]), draco::PointIndex(t[1]), draco::PointIndex(t[2])});
  }
  return result;
}

bool write_all(int socket, const char* data, std::size_t size) {
  while (size > 0) {
    const ssize_t written = ::write(socket, data, size);
    if (written <= 0) return false;
    data += written;
    size -= static_cast<std::size_t>(written);
  }
  return true;
}

int listening_socket() {
  const int listener = ::socket(AF_INET, SOCK_STREAM, 0);
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  socklen_t size = sizeof(address);
  if (::bind(listener, reinterpret_cast<sockaddr*>(&address), size) != 0 || ::listen(listener, 1) != 0) std::exit(1);
  ::getsockname(listener, reinterpret_cast<sockaddr*>(&address), &size);
  std::printf("%d\n", ntohs(address.sin_port));
  std::fflush(stdout);
  return listener;
}

}  // namespace

int main(int argument_count, char** arguments) {
  if (argument_count != 3) return 2;
  const auto scene = files::read_ply(arguments[1]);
  const double step = std::atof(arguments[2]);
  if (!scene || !(step > 0)) return 1;
  const mesh::MultispectralMesh& mesh = scene.value().mesh;
  const fusion::SceneTemperature temperature = temperature_of(mesh);
  const std::unique_ptr<draco::Mesh> encoded_mesh = draco_mesh(mesh);

  base::Vec3f low = mesh.positions()[0], high = low;
  for (const base::Vec3f& p : mesh.positions()) {
    low = {std::min(low.x, p.x), std::min(low.y, p.y), std::min(low.z, p.z)};
    high = {std::max(high.x, p.x), std::max(high.y, p.y), std::max(high.z, p.z)};
  }
  const double extent = std::max({high.x - low.x, high.y - low.y, high.z - low.z});
  const auto bits = static_cast<int>(std::bit_width(static_cast<std::uint32_t>(std::ceil(extent / step))));
  const float range = static_cast<float>(step * ((1u << bits) - 1));
  const float origin[3] = {low.x, low.y, low.z};

  const int client = ::accept(listening_socket(), nullptr, nullptr);
  const int no_delay = 1;
  ::setsockopt(client, IPPROTO_TCP, TCP_NODELAY, &no_delay, sizeof(no_delay));
  std::string line;
  for (char byte = 0; ::read(client, &byte, 1) == 1;) {
    if (byte != '\n') {
      line += byte;
      continue;
    }
    fusion::FusionChange change;
    change.params["alpha"] = std::atof(line.c_str());
    line.clear();
    const auto settings = fusion::with_change(fusion::default_settings(), change);
    if (!settings) return 1;
    const auto plan = fusion::FusionPlan::prepare(settings.value(), temperature);
    std::vector<base::Rgb8> fused(mesh.vertex_count());
    plan.value().fuse(mesh.temperature_celsius(), mesh.visible(), fused);
    std::memcpy(encoded_mesh->attribute(1)->buffer()->data(), fused.data(), fused.size() * sizeof(base::Rgb8));

    draco::ExpertEncoder encoder(*encoded_mesh);
    encoder.SetSpeedOptions(kSpeed, kSpeed);
    encoder.SetEncodingMethod(draco::MESH_EDGEBREAKER_ENCODING);
    encoder.SetAttributeExplicitQuantization(0, bits, 3, origin, range);
    draco::EncoderBuffer buffer;
    if (!encoder.EncodeToBuffer(&buffer).ok()) return 1;
    const auto size = static_cast<std::uint32_t>(buffer.size());
    if (!write_all(client, reinterpret_cast<const char*>(&size), 4) || !write_all(client, buffer.data(), size))
      return 1;
  }
  return 0;
}
