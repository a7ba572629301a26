#include "tools/export_writers.h"

#include <algorithm>
#include <bit>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <filesystem>

#include <fmt/format.h>

#include "tools/cli.h"

namespace varve::tools {
namespace {

/// A file that is written from its beginning to its end.
class OutputFile {
 public:
  OutputFile(const ExportPlan& plan, const std::string& name, std::vector<std::string>& files)
      : path_((std::filesystem::path(plan.folder) / name).string()) {
    if (!plan.overwrite && std::filesystem::exists(path_))
      throw UsageError(fmt::format("{}: exists already; --overwrite replaces it", path_));
    file_.reset(std::fopen(path_.c_str(), "wb"));
    if (!file_) fail();
    files.push_back(path_);
  }
  void write(std::string_view text) {
    if (std::fwrite(text.data(), 1, text.size(), file_.get()) != text.size()) fail();
  }
  void close() {
    if (std::fclose(file_.release()) != 0) fail();
  }

 private:
  struct Closer {
    void operator()(std::FILE* file) const { std::fclose(file); }
  };
  [[noreturn]] void fail() const {
    throw ToolError(exit_output, fmt::format("{}: {}", path_, std::strerror(errno)));
  }
  std::string path_;
  std::unique_ptr<std::FILE, Closer> file_;
};

template <class T>
T value_at(const std::vector<std::byte>& bytes, std::size_t index) {
  T value;
  std::memcpy(&value, bytes.data() + index * sizeof value, sizeof value);
  return value;
}

/// One scalar as text that reads back as the same bits.
std::string text_at(io::ScalarType type, const std::vector<std::byte>& bytes, std::size_t index) {
  switch (type) {
    case io::ScalarType::f64: return fmt::format("{}", value_at<double>(bytes, index));
    case io::ScalarType::f32: return fmt::format("{}", value_at<float>(bytes, index));
    case io::ScalarType::u64: return fmt::format("{}", value_at<std::uint64_t>(bytes, index));
    case io::ScalarType::u32: return fmt::format("{}", value_at<std::uint32_t>(bytes, index));
    case io::ScalarType::u8: break;
  }
  return fmt::format("{}", static_cast<unsigned>(value_at<std::uint8_t>(bytes, index)));
}

/// "velocity" of "grains.velocity".
std::string short_name(const io::FieldDescriptor& field) {
  const std::size_t dot = field.name.find('.');
  return dot == std::string::npos ? field.name : field.name.substr(dot + 1);
}

std::uint64_t count_of(const ExportPopulation& population, const io::Frame& frame) {
  const auto place = [&](int field) { return frame.counts[static_cast<std::size_t>(field)]; };
  if (population.position >= 0) return place(population.position);
  if (population.id >= 0) return place(population.id);
  return population.fields.empty() ? 0 : frame.counts[population.fields.front()];
}

// ---- VTK ---------------------------------------------------------------------------------------

/// Raw bytes of little-endian numbers.
class Block {
 public:
  template <class T>
  void add(T value) {
    char bytes[sizeof(T)];
    std::memcpy(bytes, &value, sizeof value);
    if constexpr (std::endian::native == std::endian::big) std::reverse(bytes, bytes + sizeof(T));
    text_.append(bytes, sizeof(T));
  }
  const std::string& text() const { return text_; }

 private:
  std::string text_;
};

const char* vtk_type(io::ScalarType type) {
  switch (type) {
    case io::ScalarType::f64: return "Float64";
    case io::ScalarType::f32: return "Float32";
    case io::ScalarType::u64: return "UInt64";
    case io::ScalarType::u32: return "UInt32";
    case io::ScalarType::u8: break;
  }
  return "UInt8";
}

void add_scalar(Block& block, io::ScalarType type, const std::vector<std::byte>& bytes,
                std::size_t index) {
  switch (type) {
    case io::ScalarType::f64: return block.add(value_at<double>(bytes, index));
    case io::ScalarType::f32: return block.add(value_at<float>(bytes, index));
    case io::ScalarType::u64: return block.add(value_at<std::uint64_t>(bytes, index));
    case io::ScalarType::u32: return block.add(value_at<std::uint32_t>(bytes, index));
    case io::ScalarType::u8: break;
  }
  block.add(value_at<std::uint8_t>(bytes, index));
}

/// Numbers of a field; two components get a third one, 0, since VTK's vectors have three.
Block block_of(const io::FieldDescriptor& field, const std::vector<std::byte>& bytes,
               std::uint64_t count) {
  Block block;
  static const std::vector<std::byte> zero(8, std::byte{0});
  for (std::size_t i = 0; i < count; ++i) {
    for (std::size_t k = 0; k < field.components; ++k)
      add_scalar(block, field.type, bytes, i * field.components + k);
    if (field.components == 2) add_scalar(block, field.type, zero, 0);
  }
  return block;
}

std::uint32_t vtk_components(const io::FieldDescriptor& field) {
  return field.components == 2 ? 3 : field.components;
}

/// The XML of arrays whose data follow behind it.
class Appended {
 public:
  std::string array(const char* type, const std::string& name, std::uint32_t components,
                    const Block& block, const std::string& more = "") {
    const std::string xml = fmt::format(
        "<DataArray type=\"{}\" Name=\"{}\" NumberOfComponents=\"{}\"{} format=\"appended\" "
        "offset=\"{}\"/>\n",
        type, name, components, more, data_.size());
    Block size;
    size.add(static_cast<std::uint64_t>(block.text().size()));
    data_ += size.text();
    data_ += block.text();
    return xml;
  }
  const std::string& data() const { return data_; }

 private:
  std::string data_;
};

class VtpWriter final : public ExportWriter {
 public:
  explicit VtpWriter(const ExportPlan& plan) : plan_(plan) {
    for (const ExportPopulation& each : plan.populations) {
      collections_.emplace_back(plan, each.name + ".pvd", files_);
      collections_.back().write(
          "<?xml version=\"1.0\"?>\n<VTKFile type=\"Collection\" version=\"0.1\" "
          "byte_order=\"LittleEndian\">\n<Collection>\n");
    }
  }
  void take(const io::Frame& frame) override {
    for (std::size_t p = 0; p < plan_.populations.size(); ++p) {
      const ExportPopulation& population = plan_.populations[p];
      const std::string name = fmt::format("{}_{:09}.vtp", population.name, frame.step);
      OutputFile file(plan_, name, files_);
      file.write(text_of(population, frame));
      file.close();
      collections_[p].write(fmt::format(
          "<DataSet timestep=\"{}\" group=\"\" part=\"0\" file=\"{}\"/>\n", frame.time, name));
    }
  }
  void finish() override {
    for (OutputFile& each : collections_) {
      each.write("</Collection>\n</VTKFile>\n");
      each.close();
    }
  }

 private:
  std::string text_of(const ExportPopulation& population, const io::Frame& frame) const {
    const std::uint64_t n = count_of(population, frame);
    Appended appended;
    Block time, step, connectivity, offsets;
    time.add(frame.time);
    step.add(frame.step);
    for (std::uint64_t i = 0; i < n; ++i) {
      connectivity.add(static_cast<std::int64_t>(i));
      offsets.add(static_cast<std::int64_t>(i + 1));
    }
    const std::string one = " NumberOfTuples=\"1\"";
    std::string xml =
        "<?xml version=\"1.0\"?>\n<VTKFile type=\"PolyData\" version=\"1.0\" "
        "byte_order=\"LittleEndian\" header_type=\"UInt64\">\n<PolyData>\n<FieldData>\n" +
        appended.array("Float64", "TimeValue", 1, time, one) +
        appended.array("UInt64", "step", 1, step, one) +
        fmt::format("</FieldData>\n<Piece NumberOfPoints=\"{0}\" NumberOfVerts=\"{0}\" "
                    "NumberOfLines=\"0\" NumberOfStrips=\"0\" NumberOfPolys=\"0\">\n<PointData>\n",
                    n);
    const auto add = [&](std::size_t f) {
      const io::FieldDescriptor& field = plan_.schema->fields[f];
      xml += appended.array(vtk_type(field.type), short_name(field), vtk_components(field),
                            block_of(field, frame.fields[f], n));
    };
    if (population.id >= 0) add(static_cast<std::size_t>(population.id));
    for (const std::size_t f : population.fields) add(f);
    Block radii;
    for (const double each : plan_.radii(population.name, frame)) radii.add(each);
    if (!radii.text().empty()) xml += appended.array("Float64", "radius", 1, radii);
    const auto position = static_cast<std::size_t>(population.position);
    const io::FieldDescriptor& field = plan_.schema->fields[position];
    xml += "</PointData>\n<Points>\n" +
           appended.array(vtk_type(field.type), "position", 3,
                          block_of(field, frame.fields[position], n)) +
           "</Points>\n<Verts>\n" + appended.array("Int64", "connectivity", 1, connectivity) +
           appended.array("Int64", "offsets", 1, offsets) +
           "</Verts>\n</Piece>\n</PolyData>\n<AppendedData encoding=\"raw\">\n_";
    return xml + appended.data() + "\n</AppendedData>\n</VTKFile>\n";
  }

  ExportPlan plan_;
  std::vector<OutputFile> collections_;
};

// ---- extended XYZ ------------------------------------------------------------------------------

class ExtxyzWriter final : public ExportWriter {
 public:
  explicit ExtxyzWriter(const ExportPlan& plan) : plan_(plan) {
    for (const ExportPopulation& each : plan.populations)
      outputs_.emplace_back(plan, each.name + ".extxyz", files_);
  }
  void take(const io::Frame& frame) override {
    for (std::size_t p = 0; p < plan_.populations.size(); ++p)
      take(plan_.populations[p], frame, outputs_[p]);
  }
  void finish() override {
    for (OutputFile& each : outputs_) each.close();
  }

 private:
  /// OVITO's names for what it knows.
  static std::string property_name(const io::FieldDescriptor& field) {
    const std::string name = short_name(field);
    if (name == "velocity") return "velo";
    if (name == "species") return "kind";
    return name;
  }
  static bool is_real(io::ScalarType type) {
    return type == io::ScalarType::f64 || type == io::ScalarType::f32;
  }
  std::string comment(const ExportPopulation& population, const io::Frame& frame,
                      bool radii) const {
    std::string text;
    if (!plan_.edges.empty()) {
      text += fmt::format("Lattice=\"{} 0 0 0 {} 0 0 0 {}\" Origin=\"{} {} {}\" pbc=\"",
                          plan_.edges[0], plan_.edges[1], plan_.edges[2], plan_.origin[0],
                          plan_.origin[1], plan_.origin[2]);
      for (std::size_t k = 0; k < 3; ++k)
        text += std::string(k ? " " : "") + (plan_.periodic[k] ? "T" : "F");
      text += "\" ";
    }
    text += "Properties=species:S:1:pos:R:3";
    if (population.id >= 0) text += ":id:I:1";
    if (radii) text += ":radius:R:1";
    for (const std::size_t f : population.fields) {
      const io::FieldDescriptor& field = plan_.schema->fields[f];
      text += fmt::format(":{}:{}:{}", property_name(field), is_real(field.type) ? "R" : "I",
                          vtk_components(field));
    }
    return text + fmt::format(" Time={} step={}", frame.time, frame.step);
  }
  void take(const ExportPopulation& population, const io::Frame& frame, OutputFile& output) const {
    const std::uint64_t n = count_of(population, frame);
    const std::vector<double> radii = plan_.radii(population.name, frame);
    output.write(fmt::format("{}\n{}\n", n, comment(population, frame, !radii.empty())));
    const auto add = [&](std::string& line, std::size_t f, std::size_t i) {
      const io::FieldDescriptor& field = plan_.schema->fields[f];
      for (std::size_t k = 0; k < field.components; ++k)
        line += " " + text_at(field.type, frame.fields[f], i * field.components + k);
      if (field.components == 2) line += " 0";
    };
    for (std::size_t i = 0; i < n; ++i) {
      std::string line = population.name;
      add(line, static_cast<std::size_t>(population.position), i);
      if (population.id >= 0) add(line, static_cast<std::size_t>(population.id), i);
      if (!radii.empty()) line += fmt::format(" {}", radii[i]);
      for (const std::size_t f : population.fields) add(line, f, i);
      output.write(line + "\n");
    }
  }

  ExportPlan plan_;
  std::vector<OutputFile> outputs_;
};

// ---- CSV ---------------------------------------------------------------------------------------

/// "m/s" as the end of a column's name: "_m_s".
std::string unit_ending(const std::string& unit) {
  if (unit.empty()) return "";
  std::string ending = "_";
  for (const char each : unit)
    ending += std::isalnum(static_cast<unsigned char>(each)) ? each : '_';
  return ending;
}

class CsvWriter final : public ExportWriter {
 public:
  explicit CsvWriter(const ExportPlan& plan) : plan_(plan) {
    for (const ExportPopulation& each : plan.populations) {
      outputs_.emplace_back(plan, each.name + ".csv", files_);
      std::string line = "step,time_s";
      for (const std::size_t f : columns_of(each)) line += names_of(plan.schema->fields[f]);
      outputs_.back().write(line + "\n");
    }
  }
  void take(const io::Frame& frame) override {
    for (std::size_t p = 0; p < plan_.populations.size(); ++p) {
      const ExportPopulation& population = plan_.populations[p];
      const std::uint64_t n = count_of(population, frame);
      for (std::size_t i = 0; i < n; ++i) {
        std::string line = fmt::format("{},{}", frame.step, frame.time);
        for (const std::size_t f : columns_of(population)) {
          const io::FieldDescriptor& field = plan_.schema->fields[f];
          for (std::size_t k = 0; k < field.components; ++k)
            line += "," + text_at(field.type, frame.fields[f], i * field.components + k);
        }
        outputs_[p].write(line + "\n");
      }
    }
  }
  void finish() override {
    for (OutputFile& each : outputs_) each.close();
  }

 private:
  static std::vector<std::size_t> columns_of(const ExportPopulation& population) {
    std::vector<std::size_t> fields;
    for (const int each : {population.id, population.position})
      if (each >= 0) fields.push_back(static_cast<std::size_t>(each));
    fields.insert(fields.end(), population.fields.begin(), population.fields.end());
    return fields;
  }
  /// ",x_m,y_m" of positions, ",vx_m_s" of velocities, else the field's name with its axes.
  static std::string names_of(const io::FieldDescriptor& field) {
    static constexpr const char* axes[] = {"x", "y", "z"};
    const std::string name = short_name(field), unit = unit_ending(field.unit);
    if (field.components == 1) return "," + name + unit;
    std::string names;
    for (std::size_t k = 0; k < field.components; ++k) {
      const std::string axis = field.components <= 3 && !field.is_id ? axes[k] : std::to_string(k);
      if (name == "position")
        names += "," + axis + unit;
      else if (name == "velocity")
        names += ",v" + axis + unit;
      else
        names += "," + name + "_" + axis + unit;
    }
    return names;
  }

  ExportPlan plan_;
  std::vector<OutputFile> outputs_;
};

}  // namespace

std::unique_ptr<ExportWriter> vtp_writer(const ExportPlan& plan) {
  return std::make_unique<VtpWriter>(plan);
}
std::unique_ptr<ExportWriter> extxyz_writer(const ExportPlan& plan) {
  return std::make_unique<ExtxyzWriter>(plan);
}
std::unique_ptr<ExportWriter> csv_writer(const ExportPlan& plan) {
  return std::make_unique<CsvWriter>(plan);
}

}  // namespace varve::tools
