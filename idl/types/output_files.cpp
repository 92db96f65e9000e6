#include "idl/types/output_files.h"

#include <algorithm>
#include <system_error>

namespace tenon {

namespace fs = std::filesystem;

std::optional<OutputRefusal> refuseOutputs(const ProgramFiles& files) {
  constexpr int kCouldNot = 1;
  constexpr int kWrongUsage = 2;
  for (const fs::path& output : files.outputs) {
    std::error_code ignored;
    const fs::file_type type = output.empty() ? fs::file_type::none : fs::status(output, ignored).type();
    if (type == fs::file_type::directory)
      return OutputRefusal{output.string() + ": is a folder; name a file", kCouldNot};
    if (type != fs::file_type::regular) continue;
    const bool is_input = std::any_of(files.inputs.begin(), files.inputs.end(), [&](const fs::path& input) {
      return fs::equivalent(output, input, ignored);
    });
    if (is_input)
      return OutputRefusal{output.string() + ": is an input of this command; name another output",
                           kWrongUsage};
    if (!files.overwrite)
      return OutputRefusal{output.string() + ": exists; --overwrite replaces it", kCouldNot};
  }
  return std::nullopt;
}

bool isWrittenInPlace(const fs::path& file) {
  std::error_code ignored;
  const fs::file_status status = fs::status(file, ignored);
  return fs::exists(status) && fs::is_other(status);
}

}  // namespace tenon
