!> Files that all ranks write together, by HDF5's driver for MPI. `parallel.F90` is that of a
!> parallel HDF5, `serial.F90` stands where the HDF5 library is a serial one.
module pd_output_results_together
  use hdf5, only: hid_t
  implicit none (type, external)
  private
  public :: can_write_together, access_together, write_together

  interface
    !> Whether the HDF5 library is a parallel one.
    module logical function can_write_together()
      implicit none (type, external)
    end function can_write_together

    !> Let all ranks open a file together.
    module subroutine access_together(properties, status)
      implicit none (type, external)
      integer(hid_t), intent(in) :: properties  !! of the access to a file
      integer, intent(out) :: status            !! is 0 where they are set
    end subroutine access_together

    !> Properties of a write in which each rank has rows of its own. To be closed by the caller.
    module subroutine write_together(properties, status)
      implicit none (type, external)
      integer(hid_t), intent(out) :: properties  !! HDF5's identifier
      integer, intent(out) :: status             !! is 0 where they are there
    end subroutine write_together
  end interface

end module pd_output_results_together
