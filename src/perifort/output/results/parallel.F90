!> Files of a parallel HDF5.
#ifdef PERIFORT_PARALLEL_HDF5
submodule(pd_output_results_together) parallel
  use hdf5, only: H5FD_MPIO_COLLECTIVE_F, H5P_DATASET_XFER_F, h5pcreate_f, &
    & h5pset_dxpl_mpio_f, h5pset_fapl_mpio_f
  use pd_comm_world, only: find_handles
  implicit none (type, external)

contains

  module procedure can_write_together
    can_write_together = .true.
  end procedure can_write_together

  module procedure access_together
    integer :: ranks, no_hints

    call find_handles(ranks, no_hints)
    call h5pset_fapl_mpio_f(properties, ranks, no_hints, status)
  end procedure access_together

  module procedure write_together
    call h5pcreate_f(H5P_DATASET_XFER_F, properties, status)
    if (status == 0) call h5pset_dxpl_mpio_f(properties, H5FD_MPIO_COLLECTIVE_F, status)
  end procedure write_together

end submodule parallel
#endif
