!> A serial HDF5: no file is written by several ranks.
#ifndef PERIFORT_PARALLEL_HDF5
submodule(pd_output_results_together) serial
  implicit none (type, external)

contains

  module procedure can_write_together
    can_write_together = .false.
  end procedure can_write_together

  module procedure access_together
    associate (unused_properties => properties)
    end associate
    status = -1  ! HDF5's word for failure
  end procedure access_together

  module procedure write_together
    properties = -1_hid_t
    status = -1
  end procedure write_together

end submodule serial
#endif
