!> Bodies that are meshes, in scenes: points, horizon, names, loads on facets, and what is refused.
module test_body_meshes
  use pd_base_error, only: fault_type => error_type
  use pd_base_kinds, only: wp
  use pd_body_mesh_elements, only: shape_numbered, shape_type
  use pd_body_mesh_part, only: facets_type, outer_facets
  use pd_body_mesh_shares, only: share_areas
  use pd_motion_loads, only: load_of, load_type
  use pd_motion_account, only: energies_of, energies_type
  use pd_motion_static_relaxation, only: run_relaxation
  use pd_scene_content_read, only: read_scene_text
  use pd_scene_content_types, only: scene_type
  use pd_set_up_prepare, only: prepare, set_up_type
  use testdrive, only: error_type, new_unittest, test_failed, unittest_type
  use bodies, only: diary_type, expect, expect_true
  use comparisons, only: expect_close
  use meshes, only: abaqus_text, block_sample, gmsh_text, number_text, sample_type, &
    & write_file
  use test_scene_expect, only: expect_parts
  implicit none (type, external)
  private
  public :: collect_body_meshes

  character(1), parameter :: lf = achar(10)
  character(*), parameter :: steel = "&material name = 'steel' youngs_modulus = 2e11 "// &
    & 'poissons_ratio = 0.3 density = 7850 /'//lf//"&time method = 'relaxation' /"//lf
  character(*), parameter :: glass = "&material name = 'glass' youngs_modulus = 7e10 "// &
    & 'poissons_ratio = 0.2 density = 2500 /'//lf

contains

  subroutine collect_body_meshes(testsuite)
    type(unittest_type), allocatable, intent(out) :: testsuite(:)
    testsuite = [ &
      & new_unittest('points, volumes and horizon of a body', test_points), &
      & new_unittest('the horizon is that of the median by volume', test_median), &
      & new_unittest('areas shared among points close the body', test_shares), &
      & new_unittest('a body one element thick shares no areas', test_thin), &
      & new_unittest('pressure and force on facets', test_loads), &
      & new_unittest('pressure that varies has the right force and moment', test_varying), &
      & new_unittest('boundaries move the points near facets', test_boundary), &
      & new_unittest('regions and materials by names', test_names), &
      & new_unittest('long: energy of uniform strain on meshes of every shape', test_patch), &
      & new_unittest('tension of a meshed plate', test_tension), &
      & new_unittest('a mesh beside a lattice and another mesh', test_together), &
      & new_unittest('pieces and nodes on each other are warned of', test_warnings), &
      & new_unittest('what is refused when a scene is read', test_refused), &
      & new_unittest('what is refused when a mesh is read', test_refused_later)]
  end subroutine collect_body_meshes

  !> Read a scene that stands in build/ and build it; `fault` is what stops it.
  subroutine build(text, set_up, fault)
    character(*), intent(in) :: text
    type(set_up_type), intent(out) :: set_up
    type(fault_type), allocatable, intent(out) :: fault
    type(scene_type) :: scene

    call read_scene_text(text, 'build/meshes.nml', scene, fault)
    if (.not. allocated(fault)) call prepare(scene, set_up, fault)
  end subroutine build

  !> As `build`; a fault fails the test.
  subroutine ready_from(text, set_up, error)
    character(*), intent(in) :: text
    type(set_up_type), intent(out) :: set_up
    type(error_type), allocatable, intent(inout) :: error
    type(fault_type), allocatable :: fault

    if (allocated(error)) return
    call build(text, set_up, fault)
    if (allocated(fault)) call test_failed(error, fault%message)
  end subroutine ready_from

  !> A block as build/block.msh.
  subroutine put_block(number, counts, lengths)
    integer, intent(in) :: number, counts(3)
    real(wp), intent(in) :: lengths(3)
    type(sample_type) :: sample

    call block_sample(number, counts, lengths, sample)
    call write_file('block.msh', gmsh_text(sample, 4, .true., .false.))
  end subroutine put_block

  function head(dim, body) result(text)
    integer, intent(in) :: dim
    character(*), intent(in), optional :: body   !! keys of the body
    character(:), allocatable :: text

    text = '&scene dimension = '//number_text(dim)//trim(merge(' thickness = 0.5', &
      & '                ', dim == 2))//trim(merge(' area = 0.5', '           ', dim == 1)) &
      & //' /'//lf//"&body name = 'part' mesh = 'block.msh'"
    if (present(body)) text = text//' '//body
    text = text//' /'//lf//steel
  end function head

  subroutine test_points(error)
    type(error_type), allocatable, intent(out) :: error
    type(set_up_type) :: set_up
    integer :: dim
    integer, parameter :: shapes(3) = [2, 6, 11]  ! lines, quadrilaterals, hexahedra

    do dim = 1, 3
      call put_block(shapes(dim), [4, 3, 2], [4.0e3_wp, 3.0e3_wp, 2.0e3_wp])
      call ready_from(head(dim, 'scale = 1e-3'), set_up, error)
      if (allocated(error)) return
      associate (body => set_up%system%body)
        call expect_true(error, body%n_points == product([4, 3, 2], mask=[1, 2, 3] <= dim), &
          & 'a point for each element')
        call expect_close(error, body%volume(body%slot), merge(1.0_wp, 0.5_wp, dim == 3), &
          & 1.0e-12_wp, 'volumes with thickness or area')
        call expect_close(error, body%spacing(body%slot), 1.0_wp, 1.0e-12_wp, 'spacings')
        call expect(error, body%x(body%slot(2), 1), 1.5_wp, 1.0e-12_wp, 'centre of the second')
        call expect(error, body%delta, 3.015_wp, 1.0e-12_wp, 'horizon')
        call expect_true(error, all(body%grid == 0), 'a mesh has no grid')
      end associate
    end do
    call put_block(11, [4, 3, 2], [4.0_wp, 3.0_wp, 2.0_wp])
    call ready_from(head(3, 'points_per_element = 8'), set_up, error)
    if (allocated(error)) return
    call expect_true(error, set_up%system%body%n_points == 192, 'eight points for each element')
    call expect_close(error, set_up%system%body%spacing(set_up%system%body%slot), 0.5_wp, &
      & 1.0e-12_wp, 'their spacings')
  end subroutine test_points

  !> A line of one short element (0.1), one of 1 and one of 3: half of the volume is in the last.
  subroutine test_median(error)
    type(error_type), allocatable, intent(out) :: error
    type(set_up_type) :: set_up

    call write_file('line.inp', '*NODE'//lf//'1,0'//lf//'2,0.1'//lf//'3,1.1'//lf//'4,4.1'//lf// &
      & '*ELEMENT, TYPE=T3D2'//lf//'1,1,2'//lf//'2,2,3'//lf//'3,3,4'//lf)
    call ready_from("&scene dimension = 1 /"//lf//"&body mesh = 'line.inp' /"//lf// &
      & "&horizon ratio = 2 /"//lf//steel, set_up, error)
    if (allocated(error)) return
    call expect(error, set_up%system%body%delta, 6.0_wp, 1.0e-12_wp, 'twice the median of 3')
    call expect_close(error, set_up%system%body%spacing(set_up%system%body%slot(1:3)), &
      & [0.1_wp, 1.0_wp, 3.0_wp], 1.0e-12_wp, 'each its own spacing')
  end subroutine test_median

  !> Sum A_k = 0 and sum A_k x_k^T = volume times identity, on meshes of every shape with straight
  !> elements, by one point and by several.
  subroutine test_shares(error)
    type(error_type), allocatable, intent(out) :: error
    type(set_up_type) :: set_up
    type(shape_type) :: shape
    type(facets_type) :: facets
    type(fault_type), allocatable :: fault
    real(wp), allocatable :: vector(:, :), area(:), x(:, :), expected(:, :)
    integer, parameter :: several(16) = [0, 2, 3, 3, 6, 4, 9, 4, 4, 4, 8, 27, 8, 6, 6, 5]
    integer :: s, r, i

    do s = 2, 16
      shape = shape_numbered(s)
      call put_block(s, [4, 3, 3], [4.0_wp, 3.0_wp, 2.4_wp])
      do r = 1, 2
        call ready_from(head(shape%dim, 'points_per_element = '//number_text(merge(1, &
          & several(s), r == 1))), set_up, error)
        if (allocated(error)) return
        associate (body => set_up%system%body)
          call outer_facets(body%parts(1), facets)
          x = body%x(body%slot, :)
          call share_areas(body%parts(1), x, facets, vector, area, fault)
          if (allocated(fault)) then
            call test_failed(error, fault%message)
            return
          end if
          allocate (expected(shape%dim, shape%dim), source=0.0_wp)
          do i = 1, shape%dim
            expected(i, i) = sum(body%volume)
          end do
          call expect_close(error, sum(vector, dim=1), 0.0_wp, 1.0e-11_wp, 'sum of areas')
          call expect_close(error, matmul(transpose(vector), x), expected, 1.0e-10_wp, &
            & 'moments of areas of '//trim(shape%name)//'s')
          call expect(error, sum(area), sum(facets%area), 1.0e-10_wp, 'areas')
          deallocate (expected)
        end associate
      end do
    end do
  end subroutine test_shares

  subroutine test_thin(error)
    type(error_type), allocatable, intent(out) :: error
    type(set_up_type) :: set_up
    type(fault_type), allocatable :: fault

    call put_block(11, [4, 3, 1], [4.0_wp, 3.0_wp, 1.0_wp])
    call build(head(3)//"&load side = 'part:RIGHT' pressure = 1 /"//lf, set_up, fault)
    call expect_parts(error, fault, 'has no points behind it|one element thick|meshes.nml:5')
  end subroutine test_thin

  !> The sum of force density times volume, and its first moment.
  subroutine total_of(set_up, number, force, moment)
    type(set_up_type), intent(in), target :: set_up
    integer, intent(in) :: number                  !! of the load
    real(wp), intent(out) :: force(:), moment(:, :)
    type(load_type), pointer :: load
    integer :: i

    load => load_of(set_up%system%terms, number)
    force = 0.0_wp
    moment = 0.0_wp
    associate (body => set_up%system%body)
      do i = 1, size(load%slots)
        associate (f => load%density(i, :)*body%volume(load%slots(i)))
          force = force + f
          moment = moment + spread(f, 2, size(f))*spread(body%x(load%slots(i), :), 1, size(f))
        end associate
      end do
    end associate
  end subroutine total_of

  !> On both ends of a block 4 x 3 x 2.4, whose area is 7.2: by the elements of the ends, by
  !> surfaces and by sets of nodes.
  subroutine test_loads(error)
    type(error_type), allocatable, intent(out) :: error
    type(set_up_type) :: set_up
    type(sample_type) :: sample
    real(wp) :: force(3), moment(3, 3)
    integer :: s
    character(*), parameter :: loads = "&load side = 'part:LEFT' pressure = 2e6 /"//lf// &
      & "&load side = 'part:RIGHT' force_x = 1e6 force_y = 3e6 /"//lf

    do s = 9, 16
      call block_sample(s, [4, 3, 3], [4.0_wp, 3.0_wp, 2.4_wp], sample)
      call write_file('block.msh', gmsh_text(sample, 2, .false., .false.))
      call write_file('block.inp', abaqus_text(sample))
      call ready_from(head(3)//loads, set_up, error)
      if (allocated(error)) return
      call check_totals()
      call ready_from('&scene dimension = 3 /'//lf//"&body name = 'part' mesh = 'block.inp' /" &
        & //lf//steel//loads, set_up, error)
      if (allocated(error)) return
      call check_totals()
      call ready_from('&scene dimension = 3 /'//lf//"&body name = 'part' mesh = 'block.inp' /" &
        & //lf//steel//"&load side = 'part:left_nodes' pressure = 2e6 /"//lf// &
        & "&load side = 'part:right_nodes' force_x = 1e6 force_y = 3e6 /"//lf, set_up, error)
      if (allocated(error)) return
      call check_totals()
    end do

  contains

    subroutine check_totals()
      call total_of(set_up, 1, force, moment)
      call expect_close(error, force, [2.0e6_wp*7.2_wp, 0.0_wp, 0.0_wp], 1.0e-4_wp, 'pressure')
      call expect_close(error, moment(1, :), 2.0e6_wp*7.2_wp*[0.0_wp, 1.5_wp, 1.2_wp], 1.0e-3_wp, &
        & 'its centre is that of the face')
      call total_of(set_up, 2, force, moment)
      call expect_close(error, force, [1.0e6_wp, 3.0e6_wp, 0.0_wp], 1.0e-5_wp, 'force')
      call expect_close(error, moment(2, :), 3.0e6_wp*[4.0_wp, 1.5_wp, 1.2_wp], 1.0e-4_wp, &
        & 'the centre of the force')
    end subroutine check_totals

  end subroutine test_loads

  !> A pressure of 1e6 y on a side of area 3 x 0.5: linear functions are reproduced, so that the
  !> force is exact.
  subroutine test_varying(error)
    type(error_type), allocatable, intent(out) :: error
    type(set_up_type) :: set_up
    real(wp) :: force(2), moment(2, 2)

    call put_block(4, [5, 4, 1], [4.0_wp, 3.0_wp, 0.0_wp])
    call ready_from(head(2)//"&load side = 'part:RIGHT' pressure = '1e6*y' /"//lf// &
      & "&load side = 'part:LEFT' pressure = '-1e6*y' /"//lf, set_up, error)
    if (allocated(error)) return
    call total_of(set_up, 1, force, moment)
    call expect_close(error, force, [-1.0e6_wp*0.5_wp*4.5_wp, 0.0_wp], 1.0e-6_wp, 'force')
  end subroutine test_varying

  !> A horizon of 1.25 takes the two rows of centres at 0.5 and 1.0 .. that are no farther.
  subroutine test_boundary(error)
    type(error_type), allocatable, intent(out) :: error
    type(set_up_type) :: set_up
    integer :: i, s
    integer, parameter :: shapes(3) = [2, 6, 11]

    do s = 1, 3
      call put_block(shapes(s), [8, 4, 4], [4.0_wp, 2.0_wp, 2.0_wp])
      call ready_from(head(s)//"&horizon length = 0.76 /"//lf// &
        & "&boundary side = 'part:LEFT' displacement_x = 0 /"//lf// &
        & "&load region = 'part:BLOCK' body_force_x = 1 /"//lf, set_up, error)
      if (allocated(error)) return
      associate (body => set_up%system%body, motion => set_up%system%motions(1))
        call expect_true(error, size(motion%slots) == 2*4**(s - 1), 'two rows')
        do i = 1, size(motion%slots)
          call expect_true(error, body%x(motion%slots(i), 1) < 0.8_wp, 'near the facets')
        end do
        call expect_true(error, all(body%layer == 0), 'no layer is added')
      end associate
    end do
  end subroutine test_boundary

  subroutine test_names(error)
    type(error_type), allocatable, intent(out) :: error
    type(set_up_type) :: set_up
    type(sample_type) :: sample

    call block_sample(6, [4, 3, 1], [4.0_wp, 3.0_wp, 0.0_wp], sample)
    call write_file('block.inp', abaqus_text(sample))
    call ready_from("&scene dimension = 2 /"//lf//"&body name = 'part' mesh = 'block.inp' "// &
      & "material = 'steel' material_set = 'ODD', 'LEFT_NODES' material_name = 'glass', 'wood' /" &
      & //lf//steel//glass//"&material name = 'wood' youngs_modulus = 1e10 poissons_ratio = 0.3 /" &
      & //lf//"&initial region = 'part:odd' displacement_y = 3 /"//lf// &
      & "&no_fail region = 'part:left_nodes' /"//lf// &
      & "&boundary region = 'part:LEFT_NODES' displacement_x = 0 /"//lf// &
      & "&load region = 'part:ODD' force_x = 1 /"//lf, set_up, error)
    if (allocated(error)) return
    associate (body => set_up%system%body, system => set_up%system)
      ! wood on the three elements at the left, over glass on every other one
      call expect_close(error, 1.0_wp*body%material(body%slot), 1.0_wp*[3, 1, 2, 1, 3, 1, 2, 1, 3, &
        & 1, 2, 1], 0.0_wp, 'materials')
      call expect_close(error, system%state%u(body%slot, 2), 1.0_wp*[3, 0, 3, 0, 3, 0, 3, 0, 3, 0, &
        & 3, 0], 0.0_wp, 'displacements')
      call expect_true(error, size(system%motions(1)%slots) == 3, 'points that are held')
    end associate
  end subroutine test_names

  !> The strain energy of uniform uniaxial strain, against that of the material. With corrected
  !> energies each point's own factors are exact, but bonds take the mean of both ends': 5 % are
  !> allowed for that.
  subroutine test_patch(error)
    type(error_type), allocatable, intent(out) :: error
    type(set_up_type) :: set_up
    type(shape_type) :: shape
    type(energies_type) :: energies
    integer, parameter :: several(16) = [0, 2, 3, 3, 6, 4, 9, 4, 4, 4, 8, 27, 8, 6, 6, 5]
    real(wp), parameter :: strain = 1.0e-6_wp
    real(wp) :: stiffness(3)
    integer :: s, r, cells

    ! uniaxial strain: E in 1D, plane stress, and 3D with nu = 0.3
    stiffness = 2.0e11_wp*[1.0_wp, 1/(1 - 0.3_wp**2), 0.7_wp/(1.3_wp*0.4_wp)]
    do s = 2, 16
      shape = shape_numbered(s)
      do r = 1, 2
        cells = merge(merge(8, 4, shape%dim == 3), merge(4, 2, shape%dim == 3), r == 1)
        if (shape%dim == 3 .and. several(s) == 4) cells = merge(5, 3, r == 1)
        call put_block(s, [cells, cells, cells], [1.0_wp, 1.0_wp, 1.0_wp])
        call ready_from(head(shape%dim, 'points_per_element = '//number_text(merge(1, &
          & several(s), r == 1))), set_up, error)
        if (allocated(error)) return
        associate (system => set_up%system)
          system%state%u(:, 1) = strain*system%body%x(:, 1)
          call energies_of(system, system%state%v, energies)
          call expect(error, energies%strain/(stiffness(shape%dim)*strain**2/2 &
            & *sum(system%body%volume)), 1.0_wp, 0.05_wp, 'energy on '//trim(shape%name)// &
            & 's of '//number_text(shape%nodes)//' nodes')
        end associate
      end do
    end do
  end subroutine test_patch

  !> A plate of triangles pulled at both ends by 1 MPa: the strain of its middle against sigma/E.
  !> The centres of triangles stand in pairs, and each has neighbours of its own: 4 % are allowed,
  !> 2.7 % were measured; 1.4 % on a mesh of Gmsh with as large triangles.
  subroutine test_tension(error)
    type(error_type), allocatable, intent(out) :: error
    type(set_up_type) :: set_up
    type(scene_type) :: scene
    type(fault_type), allocatable :: fault
    real(wp), allocatable :: x(:), u(:)
    logical, allocatable :: inner(:)
    real(wp) :: mean_x, mean_u
    type(diary_type) :: diary

    call put_block(4, [20, 20, 1], [1.0_wp, 1.0_wp, 0.0_wp])
    call read_scene_text(head(2)//"&load side = 'part:LEFT' pressure = -1e6 /"//lf// &
      & "&load side = 'part:RIGHT' pressure = -1e6 /"//lf, 'build/meshes.nml', scene, fault)
    if (.not. allocated(fault)) call prepare(scene, set_up, fault)
    if (.not. allocated(fault)) call run_relaxation(set_up%system, &
      & set_up%plan%relaxation, diary, fault)
    if (allocated(fault)) then
      call test_failed(error, fault%message)
      return
    end if
    associate (body => set_up%system%body)
      inner = body%point > 0 .and. all(abs(body%x - 0.5_wp) < 0.25_wp, dim=2)
      x = pack(body%x(:, 1), inner)
      u = pack(set_up%system%state%u(:, 1), inner)
    end associate
    mean_x = sum(x)/size(x)
    mean_u = sum(u)/size(u)
    call expect(error, sum((x - mean_x)*(u - mean_u))/sum((x - mean_x)**2)*2.0e5_wp, 1.0_wp, &
      & 0.04_wp, 'strain over sigma/E')
  end subroutine test_tension

  !> Names belong to their body, whatever stands before it.
  subroutine test_together(error)
    type(error_type), allocatable, intent(out) :: error
    type(set_up_type) :: set_up

    call put_block(6, [4, 3, 1], [4.0_wp, 3.0_wp, 0.0_wp])
    call write_file('right.inp', '*NODE'//lf//'1,4,0'//lf//'2,5,0'//lf//'3,5,1'//lf//'4,4,1'//lf &
      & //'*ELEMENT, TYPE=CPS4, ELSET=ALL'//lf//'1,1,2,3,4'//lf)
    call ready_from("&scene dimension = 2 /"//lf//"&body name = 'grid' lower = -4, 0 upper = "// &
      & "0, 3 points = 4, 3 /"//lf//"&body name = 'part' mesh = 'block.msh' /"//lf// &
      & "&body name = 'more' mesh = 'right.inp' /"//lf//steel// &
      & "&remove shape = 'box' upper = -3.2, 1 /"//lf// &
      & "&boundary region = 'more:all' displacement_x = 1 /"//lf// &
      & "&boundary region = 'part:BLOCK' displacement_x = 0 /"//lf, set_up, error)
    if (allocated(error)) return
    associate (body => set_up%system%body, motions => set_up%system%motions)
      call expect_true(error, body%n_points == 24 .and. size(motions(1)%slots) == 1 .and. &
        & size(motions(2)%slots) == 12, 'numbers of points')
      call expect_close(error, body%x(motions(1)%slots(1), :), [4.5_wp, 0.5_wp], 1.0e-14_wp, &
        & 'the point of the second mesh')
      call expect_true(error, all(body%x(motions(2)%slots, 1) > 0.0_wp), 'those of the first')
    end associate
  end subroutine test_together

  subroutine test_warnings(error)
    type(error_type), allocatable, intent(out) :: error
    type(set_up_type) :: set_up

    call write_file('two.inp', '*NODE'//lf//'1,0,0'//lf//'2,1,0'//lf//'3,1,1'//lf//'4,0,1'//lf// &
      & '5,1,0'//lf//'6,2,0'//lf//'7,2,1'//lf//'8,1,1'//lf//'*ELEMENT, TYPE=CPS4'//lf//'1,1,2,3,4' &
      & //lf//'2,5,6,7,8'//lf)
    call ready_from("&scene dimension = 2 /"//lf//"&body mesh = 'two.inp' /"//lf//steel, set_up, &
      & error)
    call expect_true(error, set_up%warnings%has('pieces of mesh 1') .and. &
      & set_up%warnings%has('twins of mesh 1'), 'both warnings')
    call expect_true(error, .not. set_up%warnings%has('skipped of mesh 1'), 'nothing is skipped')
    call write_file('two.inp', '*HEADING'//lf//'a square'//lf//'*NODE'//lf//'1,0,0'//lf//'2,1,0'// &
      & lf//'3,1,1'//lf//'4,0,1'//lf//'5,2,0'//lf//'6,2,1'//lf//'*ELEMENT, TYPE=CPS4'//lf// &
      & '1,1,2,3,4'//lf//'2,2,5,6,3'//lf//'*MATERIAL, NAME=A'//lf//'*ELASTIC'//lf//'1, 0'//lf)
    call ready_from("&scene dimension = 2 /"//lf//"&body mesh = 'two.inp' /"//lf//steel, set_up, &
      & error)
    if (allocated(error)) return
    call expect_true(error, index(set_up%warnings%text(), '2 keywords of its file are '// &
      & "skipped, first '*material'") > 0, 'what a scene says itself')
    call put_block(6, [4, 3, 1], [4.0_wp, 3.0_wp, 0.0_wp])
    call ready_from(head(2), set_up, error)
    call expect_true(error, set_up%warnings%count() == 0, 'none for a sound mesh')
  end subroutine test_warnings

  subroutine test_refused(error)
    type(error_type), allocatable, intent(out) :: error

    call put_block(6, [4, 3, 1], [4.0_wp, 3.0_wp, 0.0_wp])
    call refuse(head(2, "file = 'block.msh'"), 'not several of them')
    call refuse(head(2, 'lower = 0, 0'), 'not several of them')
    call refuse(head(2, "material_set = 'A'"), 'differ in length|1 sets, 0 materials')
    call refuse(head(2, "material_set = 'A' material_name = 'oak'"), "no material is named 'oak'")
    call refuse(head(2, 'points_per_element = 0'), 'points_per_element')
    call refuse(head(2, 'scale = 0'), 'scale')
    call refuse("&scene dimension = 2 /"//lf//"&body mesh = 'none.msh' /"//lf//steel, &
      & "cannot find the file 'none.msh'")
    call refuse("&scene dimension = 2 /"//lf//"&body lower = 0, 0 upper = 1, 1 points = 2, 2 "// &
      & "points_per_element = 4 /"//lf//steel, 'a body without a mesh')
    call refuse(head(2)//"&boundary side = 'x_min' displacement_x = 0 /", &
      & "of a body that is a mesh, which has no rows and gets no layers|'BODY:NAME'")
    call refuse(head(2)//"&load side = 'x_min' pressure = 1 /", 'of a body that is a mesh')
    call refuse(head(2)//"&boundary side = 'part:LEFT' absorbing = .true. /", &
      & 'facets of a mesh get no layer')
    call refuse(head(2)//"&load side = 'part:LEFT' stiffness = 1, 1 /", 'springs or a body force')
    call refuse(head(2)//"&load side = 'part:LEFT' body_force_x = 1 /", 'springs or a body force')
    call refuse(head(2)//"&load side = 'part:LEFT' body = 'part' pressure = 1 /", &
      & 'names its body')
    call refuse(head(2)//"&load side = 'prat:LEFT' pressure = 1 /", &
      & "no body is named 'prat'|did you mean 'part'")
    call refuse(head(2)//"&load side = 'left' pressure = 1 /", "unknown value 'left'|BODY:NAME")
    call refuse(head(2)//"&body name = 'grid' lower = 5, 0 upper = 6, 1 points = 2, 2 /"//lf// &
      & "&load region = 'grid:LEFT' force_x = 1 /", "the body 'grid' is no mesh")

  contains

    subroutine refuse(text, parts)
      character(*), intent(in) :: text, parts
      type(scene_type) :: scene
      type(fault_type), allocatable :: fault

      if (allocated(error)) return
      call read_scene_text(text, 'build/meshes.nml', scene, fault)
      call expect_parts(error, fault, parts)
    end subroutine refuse

  end subroutine test_refused

  !> Only the mesh shows these; each names the place in the scene.
  subroutine test_refused_later(error)
    type(error_type), allocatable, intent(out) :: error

    call put_block(6, [4, 3, 1], [4.0_wp, 3.0_wp, 0.0_wp])
    call refuse(head(2)//"&load side = 'part:LEFTY' pressure = 1 /", &
      & "no set of facets named 'LEFTY'|did you mean 'LEFT'|block.msh|meshes.nml:5")
    call refuse(head(2)//"&load region = 'part:LEFT' force_x = 1 /", &
      & "the set 'LEFT' holds no points|meshes.nml:5")
    call refuse(head(2)//"&load side = 'part:BLOCK' pressure = 1 /", &
      & "the set 'BLOCK' holds no facets|meshes.nml:5")
    call refuse(head(2)//"&no_fail region = 'part:NO' /", "no set of points named 'NO'")
    call refuse(head(2, "material_set = 'NO' material_name = 'steel'"), &
      & "no set of points named 'NO'")
    call refuse(head(3), 'no elements of dimension 3')
    call refuse(head(2, 'points_per_element = 3'), 'it may have 1 or 4 or 9')
    call refuse(head(2)//"&remove shape = 'box' upper = 1, 1 /", &
      & '&remove takes points of a mesh')
    call refuse(head(2)//"&horizon family = 'lattice' /", 'cannot have the lattice families')

  contains

    subroutine refuse(text, parts)
      character(*), intent(in) :: text, parts
      type(set_up_type) :: set_up
      type(fault_type), allocatable :: fault

      if (allocated(error)) return
      call build(text, set_up, fault)
      call expect_parts(error, fault, parts)
    end subroutine refuse

  end subroutine test_refused_later

end module test_body_meshes
