!> Views of single outputs: what the results file holds of one output, as datasets of their own.
!>
!> `/VTKHDF/PointData/FIELD` holds the outputs one behind the other. Programs that take a whole
!> dataset for the values of one time see `/outputs/FIELD/000012`, a virtual dataset of HDF5 that
!> has no values of its own. Tensors have one for each component, `/outputs/stress/xy/000012`, with
!> one value a point: readers of XDMF take other numbers of components than 1, 3, 6 and 9 in
!> different ways, do not agree on the order of 6, and have no names for them.
module pd_output_results_views
  use pd_base_kinds, only: i8
  use pd_base_text, only: to_text
  use pd_output_results_types, only: field_type, label_length
  implicit none (type, external)
  private
  public :: view_type, views_of, views_fit, view_of_output, view_of_cells, folder, folder_of_cells

  !> Groups that hold the views of points and of cells.
  character(*), parameter :: folder = '/outputs', folder_of_cells = '/cell_outputs'

  !> A view costs about 500 bytes and a tenth of a millisecond before the first output.
  integer(i8), parameter :: most_views = 50000_i8

  !> What a file shows of a field.
  type :: view_type
    character(label_length + 40) :: name = ''    !! for readers: `stress_xy`
    character(label_length + 40) :: group = ''   !! that has the views of all outputs
    integer :: field = 0                         !! its number
    integer :: components = 1                    !! that the view has
    integer :: component = 0                     !! the one that it shows, from 1; 0: all
  end type view_type

contains

  !> The views of every output of these fields: scalars and vectors as they are, and each component
  !> of others.
  pure function views_of(fields) result(views)
    type(field_type), intent(in) :: fields(:)    !! (any number) that every output has
    type(view_type), allocatable :: views(:)
    type(view_type) :: view
    character(:), allocatable :: rest, label
    integer :: f, c, blank

    allocate (views(0))
    do f = 1, size(fields)
      associate (field => fields(f))
        view%field = f
        if (field%components == 1 .or. (field%components == 3 .and. &
          & (field%labels == '' .or. field%labels == 'x y z'))) then
          view%name = field%name
          view%group = folder//'/'//trim(field%name)
          view%components = field%components
          view%component = 0
          views = [views, view]
          cycle
        end if
        rest = trim(field%labels)
        view%components = 1
        do c = 1, field%components
          blank = index(rest//' ', ' ')
          label = rest(:blank - 1)
          if (label == '') label = to_text(c)
          view%component = c
          view%name = trim(field%name)//'_'//label
          view%group = folder//'/'//trim(field%name)//'/'//label
          views = [views, view]
          rest = trim(adjustl(rest(min(blank, len(rest) + 1):)))
        end do
      end associate
    end do
  end function views_of

  !> The view of the cells that belongs to one of the points: `/cell_outputs/damage`.
  elemental type(view_type) function view_of_cells(view) result(of_cells)
    type(view_type), intent(in) :: view          !! of the points
    of_cells = view
    of_cells%group = folder_of_cells//trim(view%group(len(folder) + 1:))
  end function view_of_cells

  !> Whether a file with room for `outputs` outputs of these fields has views of them.
  pure logical function views_fit(fields, outputs)
    type(field_type), intent(in) :: fields(:)    !! (any number) that every output has
    integer(i8), intent(in) :: outputs           !! that there is to be room for
    views_fit = size(views_of(fields))*outputs <= most_views
  end function views_fit

  !> Where the view of an output is in the file: `/outputs/damage/000012`. All have the same length.
  pure function view_of_output(view, output) result(path)
    type(view_type), intent(in) :: view          !! of a field or component
    integer(i8), intent(in) :: output            !! number of the output, from 0
    character(:), allocatable :: path
    character(20) :: number

    write (number, '(i0.6)') output
    path = trim(view%group)//'/'//trim(number)
  end function view_of_output

end module pd_output_results_views
