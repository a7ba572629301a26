// varve export: files read back by a parser of their own give the recorded bits.
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <map>
#include <sstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "io/log_reader.h"
#include "tests/tools/json_schema.h"
#include "tests/tools/verbs.h"

namespace varve::test {
namespace {

using ::testing::HasSubstr;

std::string bytes_of(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  EXPECT_TRUE(file) << path;
  std::ostringstream text;
  text << file.rdbuf();
  return text.str();
}

/// Number in the bytes of a little-endian file.
template <class T>
T little(const std::string& bytes, std::size_t at) {
  std::uint64_t bits = 0;
  for (std::size_t k = 0; k < sizeof(T); ++k)
    bits |= std::uint64_t{static_cast<unsigned char>(bytes.at(at + k))} << (8 * k);
  T value;
  if constexpr (sizeof(T) == 4) {
    const auto narrow = static_cast<std::uint32_t>(bits);
    std::memcpy(&value, &narrow, 4);
  } else {
    std::memcpy(&value, &bits, 8);
  }
  return value;
}

/// A .vtp file with appended raw data, as far as PolyData of points needs it.
class Vtp {
 public:
  explicit Vtp(const std::string& path) : text_(bytes_of(path)) {
    EXPECT_THAT(text_, HasSubstr("type=\"PolyData\""));
    EXPECT_THAT(text_, HasSubstr("byte_order=\"LittleEndian\" header_type=\"UInt64\""));
    const std::string mark = "<AppendedData encoding=\"raw\">\n_";
    const std::size_t data = text_.find(mark);
    EXPECT_NE(data, std::string::npos);
    data_ = data + mark.size();
    for (std::size_t at = 0; (at = text_.find("<DataArray ", at)) < data; ++at) {
      const std::string tag = text_.substr(at, text_.find("/>", at) - at);
      arrays_[attribute(tag, "Name")] = tag;
    }
    points = std::stoul(attribute(text_.substr(0, data), "NumberOfPoints"));
  }
  template <class T>
  std::vector<T> array(const std::string& name) const {
    const std::string& tag = arrays_.at(name);
    const std::size_t at = data_ + std::stoul(attribute(tag, "offset"));
    const auto size = little<std::uint64_t>(text_, at);
    EXPECT_EQ(size % sizeof(T), 0u);
    std::vector<T> values;
    for (std::size_t k = 0; k < size / sizeof(T); ++k)
      values.push_back(little<T>(text_, at + 8 + k * sizeof(T)));
    return values;
  }
  std::string type(const std::string& name) const { return attribute(arrays_.at(name), "type"); }
  std::size_t components(const std::string& name) const {
    return std::stoul(attribute(arrays_.at(name), "NumberOfComponents"));
  }
  bool has(const std::string& name) const { return arrays_.count(name) > 0; }
  /// Bytes behind the last array up to the closing tag: only a line's end.
  bool ends_where_the_arrays_end() const {
    std::size_t end = data_;
    for (const auto& [name, tag] : arrays_) {
      const std::size_t at = data_ + std::stoul(attribute(tag, "offset"));
      end = std::max(end, at + 8 + little<std::uint64_t>(text_, at));
    }
    return text_.compare(end, std::string::npos, "\n</AppendedData>\n</VTKFile>\n") == 0;
  }
  std::size_t points = 0;

 private:
  static std::string attribute(const std::string& tag, const std::string& name) {
    const std::size_t at = tag.find(" " + name + "=\"");
    EXPECT_NE(at, std::string::npos) << name << " in " << tag.substr(0, 200);
    const std::size_t from = at + name.size() + 3;
    return tag.substr(from, tag.find('"', from) - from);
  }
  std::string text_;
  std::size_t data_ = 0;
  std::map<std::string, std::string> arrays_;
};

class Export : public ::testing::Test {
 protected:
  void SetUp() override {
    run_ = folder_ / "crowd.varve";
    verb(0, {"run", folder_.write("crowd.cfg", crowd_scene()), "-o", run_, "-q"});
    log_ = io::LogReader::open(run_);
  }
  template <class T>
  std::vector<T> recorded(std::uint64_t step, const std::string& field) const {
    const auto frame = log_->frame(step);
    const auto& bytes = frame->fields.at(
        static_cast<std::size_t>(log_->genesis().schema.find(field)));
    std::vector<T> values(bytes.size() / sizeof(T));
    std::memcpy(values.data(), bytes.data(), bytes.size());
    return values;
  }
  TemporaryFolder folder_;
  std::string run_;
  std::unique_ptr<io::LogReader> log_;
};

TEST_F(Export, VtpHoldsTheRecordedBits) {
  const std::string out = folder_ / "vtp";
  const Json made = json_verb(0, {"export", run_, "--to", "vtp", "--range", "10:50:20", "-o", out});
  EXPECT_THAT(JsonSchema("export").breaches(made), testing::IsEmpty()) << made.dump(1);
  EXPECT_EQ(made["states"], "3");
  EXPECT_EQ(made["files"].size(), 2u + 2 * 3);
  const Vtp grains(out + "/grains_000000030.vtp"), fluid(out + "/fluid_000000030.vtp");
  EXPECT_EQ(grains.points, 6u);
  EXPECT_TRUE(grains.ends_where_the_arrays_end());
  EXPECT_TRUE(fluid.ends_where_the_arrays_end());
  EXPECT_EQ(grains.array<std::uint64_t>("id"), recorded<std::uint64_t>(30, "grains.id"));
  EXPECT_EQ(grains.type("species"), "UInt32");
  EXPECT_EQ(grains.array<double>("radius"), std::vector<double>(6, 1.25e-3));
  EXPECT_EQ(grains.array<double>("TimeValue").at(0), log_->header(30)->time);
  EXPECT_EQ(grains.array<std::int64_t>("connectivity"),
            (std::vector<std::int64_t>{0, 1, 2, 3, 4, 5}));
  EXPECT_EQ(grains.array<std::int64_t>("offsets"), (std::vector<std::int64_t>{1, 2, 3, 4, 5, 6}));
  for (const auto& [file, population] : {std::pair(&grains, "grains"), std::pair(&fluid, "fluid")})
    for (const char* name : {"position", "velocity"}) {
      EXPECT_EQ(file->components(name), 3u);
      const std::vector<double> stored = file->array<double>(name);
      const std::vector<double> expected =
          recorded<double>(30, std::string(population) + "." + name);
      ASSERT_EQ(stored.size() / 3, expected.size() / 2);
      for (std::size_t i = 0; i < stored.size(); ++i)
        EXPECT_EQ(stored[i], i % 3 == 2 ? 0 : expected[i / 3 * 2 + i % 3]) << name << i;
    }
  const std::string collection = bytes_of(out + "/grains.pvd");
  for (const char* step : {"000000010", "000000030", "000000050"})
    EXPECT_THAT(collection, HasSubstr(std::string("file=\"grains_") + step + ".vtp\""));
  EXPECT_THAT(collection, HasSubstr("</Collection>\n</VTKFile>\n"));
}

TEST_F(Export, FloatsStayFloats) {
  const std::string single = folder_ / "single.varve", out = folder_ / "vtp";
  verb(0, {"run", folder_ / "crowd.cfg", "-o", single, "-s", "scenario.precision=float", "-q"});
  verb(0, {"export", single, "--to", "vtp", "--range", "20", "-o", out, "-q"});
  const Vtp grains(out + "/grains_000000020.vtp");
  EXPECT_EQ(grains.type("velocity"), "Float32");
  log_ = io::LogReader::open(single);
  const std::vector<float> v = recorded<float>(20, "grains.velocity");
  const std::vector<float> stored = grains.array<float>("velocity");
  EXPECT_EQ(stored.at(0), v.at(0));
  EXPECT_EQ(stored.at(4), v.at(3));
}

TEST_F(Export, ExtxyzHasAFramePerStateWithExactNumbers) {
  const std::string out = folder_ / "xyz";
  verb(0, {"export", run_, "--to", "extxyz", "--range", "0:120:60", "--fields",
           "grains.velocity,grains.spin", "-o", out, "-q"});
  EXPECT_FALSE(std::filesystem::exists(out + "/fluid.extxyz"));
  std::istringstream lines(bytes_of(out + "/grains.extxyz"));
  std::string line;
  for (const std::uint64_t step : {0u, 60u, 120u}) {
    std::getline(lines, line);
    EXPECT_EQ(line, "6");
    std::getline(lines, line);
    EXPECT_THAT(line, HasSubstr("Lattice=\"0.012 0 0 0 0.014 0 0 0 0.0025\""));
    EXPECT_THAT(line, HasSubstr("pbc=\"F F F\""));
    EXPECT_THAT(line, HasSubstr("Properties=species:S:1:pos:R:3:id:I:1:radius:R:1:velo:R:3:"
                                "spin:R:1 "));
    EXPECT_THAT(line, HasSubstr(" step=" + std::to_string(step)));
    const std::vector<double> x = recorded<double>(step, "grains.position"),
                              v = recorded<double>(step, "grains.velocity"),
                              w = recorded<double>(step, "grains.spin");
    for (std::size_t i = 0; i < 6; ++i) {
      std::string name;
      double px = 0, py = 0, pz = 1, id = 0, radius = 0, vx = 0, vy = 0, vz = 1, spin = 0;
      std::getline(lines, line);
      std::istringstream(line) >> name >> px >> py >> pz >> id >> radius >> vx >> vy >> vz >> spin;
      EXPECT_EQ(name, "grains");
      EXPECT_EQ(px, x[2 * i]);
      EXPECT_EQ(py, x[2 * i + 1]);
      EXPECT_EQ(pz, 0);
      EXPECT_EQ(id, static_cast<double>(i));
      EXPECT_EQ(radius, 1.25e-3);
      EXPECT_EQ(vx, v[2 * i]);
      EXPECT_EQ(vy, v[2 * i + 1]);
      EXPECT_EQ(spin, w[i]);
    }
  }
  EXPECT_FALSE(std::getline(lines, line));
}

TEST_F(Export, CsvNamesItsUnitsAndReadsBackExactly) {
  const std::string out = folder_ / "csv";
  verb(0, {"export", run_, "--to", "csv", "--range", "last", "--fields", "grains,contacts", "-o",
           out, "-q"});
  std::istringstream lines(bytes_of(out + "/grains.csv"));
  std::string line;
  std::getline(lines, line);
  EXPECT_EQ(line, "step,time_s,id,x_m,y_m,species,vx_m_s,vy_m_s,spin_rad_s");
  const std::vector<double> v = recorded<double>(120, "grains.velocity");
  for (std::size_t i = 0; i < 6; ++i) {
    std::getline(lines, line);
    std::vector<std::string> cells;
    std::string each;
    for (std::istringstream cut(line); std::getline(cut, each, ',');) cells.push_back(each);
    ASSERT_EQ(cells.size(), 9u);
    EXPECT_EQ(cells[0], "120");
    EXPECT_EQ(std::strtod(cells[6].c_str(), nullptr), v[2 * i]);
    EXPECT_EQ(std::strtod(cells[7].c_str(), nullptr), v[2 * i + 1]);
  }
  EXPECT_THAT(bytes_of(out + "/contacts.csv"),
              HasSubstr("step,time_s,key_0,key_1,key_2,spring_x_m,spring_y_m\n"));
}

TEST_F(Export, WhatItCannotDoIsSaid) {
  const std::string out = folder_ / "out";
  EXPECT_THAT(verb(2, {"export", run_, "-o", out}).errors, HasSubstr("vtp, csv or extxyz"));
  EXPECT_THAT(verb(2, {"export", run_, "--to", "obj", "-o", out}).errors, HasSubstr("got 'obj'"));
  EXPECT_THAT(verb(2, {"export", run_, "--to", "vtp"}).errors, HasSubstr("-o"));
  EXPECT_THAT(verb(2, {"export", run_, "--to", "vtp", "--fields", "contacts", "-o", out}).errors,
              HasSubstr("has no positions; --to csv writes it"));
  EXPECT_THAT(verb(2, {"export", run_, "--to", "csv", "--fields", "grain", "-o", out}).errors,
              HasSubstr("no field or population 'grain'"));
  verb(0, {"export", run_, "--to", "csv", "--range", "0", "-o", out, "-q"});
  EXPECT_THAT(verb(2, {"export", run_, "--to", "csv", "--range", "0", "-o", out}).errors,
              HasSubstr("exists already; --overwrite"));
  verb(0, {"export", run_, "--to", "csv", "--range", "0", "-o", out, "-q", "--overwrite"});
  const std::string digests = folder_ / "digests.varve";
  verb(0, {"run", folder_ / "crowd.cfg", "-o", digests, "-s", "record.tier=digests", "-q"});
  EXPECT_THAT(
      verb(2, {"export", digests, "--to", "csv", "--range", "5:9", "-o", folder_ / "no"}).errors,
      HasSubstr("no state of steps 5 to 9 is stored"));
  std::filesystem::create_directories(folder_ / "full");
  std::filesystem::create_symlink("/dev/full", folder_ / "full/grains.csv");
  EXPECT_THAT(
      verb(74, {"export", run_, "--to", "csv", "--overwrite", "-o", folder_ / "full"}).errors,
      HasSubstr("grains.csv"));
}

// VTK's own reader, where it is installed.
TEST_F(Export, VtkReadsWhatWasWritten) {
  if (std::system("python3 -c 'import vtk' >/dev/null 2>&1") != 0)
    GTEST_SKIP() << "python3-vtk9 is not installed";
  const std::string out = folder_ / "vtp";
  verb(0, {"export", run_, "--to", "vtp", "--range", "30", "-o", out, "-q"});
  const std::string script = folder_.write("read.py", R"(
import sys, vtk
reader = vtk.vtkXMLPolyDataReader()
reader.SetFileName(sys.argv[1])
reader.Update()
data = reader.GetOutput()
print(data.GetNumberOfPoints(), data.GetNumberOfVerts())
for i in range(data.GetNumberOfPoints()):
    print(*(x.hex() for x in data.GetPoint(i)))
    print(*(x.hex() for x in data.GetPointData().GetArray('velocity').GetTuple(i)))
)");
  const CommandResult read =
      run_command({"/usr/bin/python3", script, out + "/grains_000000030.vtp"}, {"", {}, ""});
  ASSERT_EQ(read.code, 0) << read.errors;
  std::istringstream lines(read.output);
  std::string line;
  std::getline(lines, line);
  EXPECT_EQ(line, "6 6");
  const std::vector<double> x = recorded<double>(30, "grains.position"),
                            v = recorded<double>(30, "grains.velocity");
  for (std::size_t i = 0; i < 6; ++i)
    for (const std::vector<double>* field : {&x, &v}) {
      std::getline(lines, line);
      std::string a, b;
      std::istringstream(line) >> a >> b;
      EXPECT_EQ(std::strtod(a.c_str(), nullptr), (*field)[2 * i]);
      EXPECT_EQ(std::strtod(b.c_str(), nullptr), (*field)[2 * i + 1]);
    }
}

}  // namespace
}  // namespace varve::test
