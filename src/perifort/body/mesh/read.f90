!> Reading the mesh of a body: by the kind of its file, checked, in metres.
module pd_body_mesh_read
  use pd_base_error, only: error_type, fail
  use pd_base_kinds, only: wp
  use pd_base_text, only: lower_case, newline
  use pd_body_mesh_abaqus, only: read_abaqus
  use pd_body_mesh_cursor, only: cursor_type
  use pd_body_mesh_gmsh, only: read_gmsh
  use pd_body_mesh_mesh, only: check_mesh, mesh_type
  use pd_scene_format_file, only: read_text_file
  implicit none (type, external)
  private
  public :: read_mesh, read_mesh_text

contains

  !> Read a mesh: of Gmsh (.msh) or Abaqus and CalculiX (.inp). An error if the file cannot be read,
  !> has another format, or holds what cannot be a body of the dimension.
  subroutine read_mesh(path, dim, scale, mesh, error)
    character(*), intent(in) :: path       !! of the file
    integer, intent(in) :: dim             !! of the scene
    real(wp), intent(in) :: scale          !! metres of one unit of the file
    type(mesh_type), intent(out) :: mesh   !! checked
    type(error_type), allocatable, intent(out) :: error
    character(:), allocatable :: text

    call read_text_file(path, text, error)
    if (allocated(error)) return
    call read_mesh_text(text, path, dim, scale, mesh, error)
  end subroutine read_mesh

  !> Read a mesh from the text of its file, with the errors of `read_mesh`.
  subroutine read_mesh_text(text, path, dim, scale, mesh, error)
    character(:), allocatable, intent(inout) :: text  !! of the file; deallocated on return
    character(*), intent(in) :: path                  !! its name, which tells the format
    integer, intent(in) :: dim                        !! of the scene
    real(wp), intent(in) :: scale                     !! metres of one unit of the file
    type(mesh_type), intent(out) :: mesh              !! checked
    type(error_type), allocatable, intent(out) :: error
    type(cursor_type) :: cursor
    character(:), allocatable :: ending

    mesh%file = path
    cursor%file = path
    call move_alloc(text, cursor%text)
    ending = lower_case(path(index(path, '.', back=.true.) + 1:))
    select case (ending)
    case ('msh')
      call read_gmsh(cursor, mesh, error)
    case ('inp')
      call read_abaqus(cursor, mesh, error)
    case default
      call fail(error, "the format of the mesh is unknown: '."//ending//"'"//newline//' --> '// &
        & path//newline//'  = .msh (Gmsh 2.2, 4.1) and .inp (Abaqus, CalculiX) are read; '// &
        & 'convert others by ./pf convert FILE')
    end select
    if (allocated(error)) return
    mesh%x(:, :mesh%n_nodes) = scale*mesh%x(:, :mesh%n_nodes)
    call check_mesh(mesh, dim, error)
  end subroutine read_mesh_text

end module pd_body_mesh_read
