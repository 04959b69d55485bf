// A length in a message from outside is believed only as far as there are bytes behind it.
//
// Generated code asks Cdr::jump whether a sequence of the length that a message claims can be in it, and then makes room for
// it. The buffer of a service's request belongs to Fast CDR, whose jump does not say no there but makes the buffer longer: a
// request of 24 bytes that claims 2^24 entries took gigabytes. This jump replaces the one of libfastcdr in a process that
// loads this library first (afm_node_common/entry.py); code that reads calls it, nothing that writes does.
#include <fastcdr/Cdr.h>

namespace eprosima {
namespace fastcdr {

bool Cdr::jump(size_t num_bytes)
{
  // Alignment may have led beyond the end: then nothing is left.
  const ptrdiff_t left = &end_ - &offset_;
  if (left < 0 || static_cast<size_t>(left) < num_bytes) {
    return false;
  }
  offset_ += num_bytes;
  last_data_size_ = 0;
  return true;
}

}  // namespace fastcdr
}  // namespace eprosima
