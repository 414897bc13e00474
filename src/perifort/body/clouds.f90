!> Bodies that are clouds: points with volumes from a text file, columns x y z volume.
module pd_body_clouds
  use pd_base_error, only: error_type, fail
  use pd_base_kinds, only: wp
  use pd_base_text, only: newline, to_text
  use pd_body_body, only: allocate_points, body_type
  use pd_body_shapes, only: touch
  use pd_scene_content_rules, only: place_fault
  use pd_scene_content_types, only: scene_type
  use pd_scene_format_file, only: resolve_path
  use pd_scene_format_pieces, only: find_pieces, piece_type, read_piece
  use pd_scene_format_table, only: read_table, table_type
  implicit none (type, external)
  private
  public :: cloud_type, cloud_points, begin_cloud, pieces_of_cloud, cloud_piece, points_of_rows

  !> The file of a cloud that is read in pieces.
  type :: cloud_type
    character(:), allocatable :: path
    integer :: dim = 0
    real(wp) :: depth = 1.0_wp             !! what makes an area or length a volume
    real(wp) :: unused(3) = 0.0_wp         !! coordinates of the first point; those that the
                                           !! dimension does not use are the same for all
  end type cloud_type

contains

  !> All points of a cloud. An error, with its place, if the file cannot be read, if a point has no
  !> positive volume, or if points differ in a coordinate that the dimension does not use.
  subroutine cloud_points(scene, number, depth, body, error)
    type(scene_type), intent(in) :: scene        !! a checked scene
    integer, intent(in) :: number                !! of the body
    real(wp), intent(in) :: depth                !! what makes an area or length a volume
    type(body_type), intent(out) :: body         !! its points, in the order of the file
    type(error_type), allocatable, intent(out) :: error
    type(cloud_type) :: cloud
    type(table_type) :: table
    real(wp), allocatable :: rows(:, :)

    call name_cloud(scene, number, depth, cloud)
    call read_table(cloud%path, table, error, columns=4)
    if (.not. allocated(error)) then
      cloud%unused = table%values(:3, 1)
      call take_rows(cloud, table, rows, error)
    end if
    call place_fault(error, scene, 'body', number, 'file')
    if (.not. allocated(error)) call points_of_rows(rows, depth, body)
  end subroutine cloud_points

  !> Where the pieces of a cloud are in its file. An error, with its place, if that cannot be read.
  subroutine pieces_of_cloud(scene, number, most, pieces, error)
    type(scene_type), intent(in) :: scene        !! a checked scene
    integer, intent(in) :: number                !! of the body
    integer, intent(in) :: most                  !! points of a piece
    type(piece_type), allocatable, intent(out) :: pieces(:)
    type(error_type), allocatable, intent(out) :: error

    call find_pieces(resolve_path(trim(scene%bodies(number)%file), scene%file), most, pieces, error)
    call place_fault(error, scene, 'body', number, 'file')
  end subroutine pieces_of_cloud

  !> Get ready to read pieces of a cloud: its first point is known then. An error, with its place,
  !> if the first piece cannot be read.
  subroutine begin_cloud(scene, number, depth, first, cloud, error)
    type(scene_type), intent(in) :: scene        !! a checked scene
    integer, intent(in) :: number                !! of the body
    real(wp), intent(in) :: depth                !! what makes an area or length a volume
    type(piece_type), intent(in) :: first        !! the first of `pieces_of_cloud`
    type(cloud_type), intent(out) :: cloud
    type(error_type), allocatable, intent(out) :: error
    type(table_type) :: table

    call name_cloud(scene, number, depth, cloud)
    if (cloud%dim == 3) return
    call read_piece(cloud%path, first, table, error, columns=4)
    call place_fault(error, scene, 'body', number, 'file')
    if (.not. allocated(error)) cloud%unused = table%values(:3, 1)
  end subroutine begin_cloud

  !> The points of a piece, with the errors of `cloud_points`, which have no place in the scene.
  subroutine cloud_piece(cloud, piece, rows, error)
    type(cloud_type), intent(in) :: cloud        !! from `begin_cloud`
    type(piece_type), intent(in) :: piece        !! one of its pieces
    real(wp), allocatable, intent(out) :: rows(:, :)
      !! (dim + 1, points) positions [m] and volumes [m3]
    type(error_type), allocatable, intent(out) :: error
    type(table_type) :: table

    call read_piece(cloud%path, piece, table, error, columns=4)
    if (.not. allocated(error)) call take_rows(cloud, table, rows, error)
  end subroutine cloud_piece

  !> Points with the positions and volumes of rows.
  pure subroutine points_of_rows(rows, depth, body)
    real(wp), intent(in) :: rows(:, :)   !! (dim + 1, points) positions [m] and volumes [m3]
    real(wp), intent(in) :: depth        !! what makes an area or length a volume
    type(body_type), intent(out) :: body
    integer :: dim, i

    dim = size(rows, 1) - 1
    call allocate_points(body, dim, size(rows, 2))
    body%x = transpose(rows(:dim, :))
    body%volume = rows(dim + 1, :)
    ! one by one: the power of several at once may differ in its last digit from that of one, and a
    ! point's spacing must not depend on which others are here
    !GCC$ novector
    do i = 1, body%n_points
      body%spacing(i) = (body%volume(i)/depth)**(1.0_wp/dim)
    end do
  end subroutine points_of_rows

  !> What is known of a cloud without reading it.
  subroutine name_cloud(scene, number, depth, cloud)
    type(scene_type), intent(in) :: scene
    integer, intent(in) :: number
    real(wp), intent(in) :: depth
    type(cloud_type), intent(out) :: cloud

    cloud%path = resolve_path(trim(scene%bodies(number)%file), scene%file)
    cloud%dim = scene%header%dimension
    cloud%depth = depth
  end subroutine name_cloud

  !> Check the rows of a table; the first one at fault is reported.
  subroutine take_rows(cloud, table, rows, error)
    type(cloud_type), intent(in) :: cloud
    type(table_type), intent(in) :: table
    real(wp), allocatable, intent(out) :: rows(:, :)  !! as of `cloud_piece`
    type(error_type), allocatable, intent(out) :: error
    integer :: i, c

    associate (values => table%values, dim => cloud%dim)
      do i = 1, size(values, 2)
        if (values(4, i) <= 0.0_wp) then
          call fail(error, 'every point of a cloud needs a positive volume (the fourth '// &
            & 'column), but here it is '//to_text(values(4, i))//newline//' --> '// &
            & cloud%path//':'//to_text(table%lines(i)))
          return
        end if
        do c = dim + 1, 3
          if (abs(values(c, i) - cloud%unused(c)) <= touch*(values(4, i)/cloud%depth) &
            & **(1.0_wp/dim)) cycle
          call fail(error, 'a scene of dimension '//to_text(dim)//' has no direction '// &
            & 'xyz'(c:c)//', but the points of the cloud differ in it: '// &
            & to_text(cloud%unused(c))//' and '//to_text(values(c, i))//newline// &
            & ' --> '//cloud%path//':'//to_text(table%lines(i)))
          return
        end do
      end do
      allocate (rows(dim + 1, size(values, 2)))
      rows(:dim, :) = values(:dim, :)
      rows(dim + 1, :) = values(4, :)
    end associate
  end subroutine take_rows

end module pd_body_clouds
